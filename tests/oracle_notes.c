/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/oracle_notes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define OF_GEOMS                                                                                \
  "number of geoms|shape of geom|place of geom|turn of geom|size|box of mesh|friction of geom|" \
  "contype|conaffinity|colour|rows of field|columns of field|height of field|"
#define OF_MASS "mass|centre|inertia|trace of inertia|"

/* A line with both words may be the reason of these differences; all: NULL. Where `names` it has
 * the name of what differs, too. */
typedef struct reason {
  const char *words[2];
  const char *differences;
  bool names;
} reason;

static const reason reasons[] = {
    {{": attach left out", ""}, NULL, false}, /* with it a whole tree */
    {{": geom ", " left out, and its mass: "}, OF_GEOMS OF_MASS, false},
    {{": mesh: mass left out", ""}, OF_MASS, false},
    {{": boundinertia left out", ""}, OF_MASS, false},
    {{": joint: springdamper left out", ""}, "stiffness|damping|", false},
    {{": joint: what is not linear of stiffness left out", ""}, "stiffness|", false},
    {{": joint: what is not linear of damping left out", ""}, "damping|", false},
    {{": joint: stiffness below 0 left out", ""}, "stiffness|", false},
    {{": joint: damping below 0 left out", ""}, "damping|", false},
    {{": joint ", ": limit of a continuous joint left out"}, "being limited|", true},
    {{": joint ", ": limit that does not rise left out"}, "being limited|", true},
    {{": joint ", ": damping below 0 left out"}, "damping|", true},
    {{": joint ", ", which is planar, left out"}, "number of joints|", false},
    {{": collision of link ", " left out: "}, OF_GEOMS OF_MASS, true},
};

void oracle_note_take(void *user, const char *line)
{
  oracle_notes *to = user;
  if (to->count < ORACLE_NOTES_MOST) {
    to->lines[to->count++] = strdup(line);
  }
}

void oracle_notes_free(oracle_notes *notes)
{
  for (size_t i = 0; i < notes->count; ++i) {
    free(notes->lines[i]);
  }
  notes->count = 0;
}

/* Whether a list of words, each ending in '|', has this one. */
static bool list_has(const char *list, const char *word)
{
  const size_t length = strlen(word);
  for (const char *at = list; *at != '\0'; at = strchr(at, '|') + 1) {
    if (strncmp(at, word, length) == 0 && at[length] == '|') {
      return true;
    }
  }
  return false;
}

/* "file:line: text" with a line above 0. */
static bool line_has_place(const char *line)
{
  const char *colon = strchr(line, ':');
  return colon != NULL && atoi(colon + 1) > 0;
}

static bool line_explains(const char *line, const reason *r, const char *of)
{
  const char *first = strstr(line, r->words[0]);
  const char *second = first != NULL ? strstr(first, r->words[1]) : NULL;
  if (second == NULL || !line_has_place(line)) {
    return false;
  }
  const char *name = first + strlen(r->words[0]);
  return !r->names || (strlen(of) == (size_t)(second - name) && strncmp(name, of, strlen(of)) == 0);
}

bool oracle_notes_explain(const oracle_notes *notes, const char *what, const char *of)
{
  for (size_t k = 0; k < sizeof reasons / sizeof reasons[0]; ++k) {
    const reason *r = &reasons[k];
    for (size_t i = 0; i < notes->count; ++i) {
      if ((r->differences == NULL || list_has(r->differences, what)) &&
          line_explains(notes->lines[i], r, of)) {
        return true;
      }
    }
  }
  return false;
}
