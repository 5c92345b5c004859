/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The comparison of scene files with MuJoCo finds what is wrong in silence: a line is the reason of
 * its own kind of difference alone, and of the thing that it names. */

#include "tests/tap.h"

#include "tests/oracle_notes.h"

TEST(a_line_explains_its_own_kind_of_difference)
{
  oracle_notes notes = {.count = 0};
  CHECK(!oracle_notes_explain(&notes, "mass", "arm"));
  oracle_note_take(&notes, "a.xml:3: actuator left out, 2 in it");
  oracle_note_take(&notes, "a.xml:7: joint: springdamper left out");
  CHECK(oracle_notes_explain(&notes, "stiffness", "hip"));
  CHECK(oracle_notes_explain(&notes, "damping", "hip"));
  CHECK(!oracle_notes_explain(&notes, "mass", "hip"));
  CHECK(!oracle_notes_explain(&notes, "place", "hip"));
  oracle_note_take(&notes, "a.xml:9: geom foot left out, and its mass: its mesh is");
  CHECK(oracle_notes_explain(&notes, "mass", "leg"));
  CHECK(oracle_notes_explain(&notes, "shape of geom", "sole"));
  CHECK(!oracle_notes_explain(&notes, "axis", "hip"));
  CHECK(!oracle_notes_explain(&notes, "number of bodies", "world"));
  oracle_notes_free(&notes);
  CHECK(!oracle_notes_explain(&notes, "mass", "leg"));
}

TEST(a_line_with_a_name_explains_that_thing_alone)
{
  oracle_notes notes = {.count = 0};
  oracle_note_take(&notes, "r.urdf:8: joint wheel: limit of a continuous joint left out");
  CHECK(oracle_notes_explain(&notes, "being limited", "wheel"));
  CHECK(!oracle_notes_explain(&notes, "being limited", "wheel2"));
  CHECK(!oracle_notes_explain(&notes, "being limited", "whee"));
  CHECK(!oracle_notes_explain(&notes, "range", "wheel"));
  oracle_notes_free(&notes);
}

TEST(a_line_without_a_place_explains_nothing)
{
  oracle_notes notes = {.count = 0};
  oracle_note_take(&notes, "a.xml: attach left out");
  CHECK(!oracle_notes_explain(&notes, "mass", "leg"));
  oracle_note_take(&notes, "a.xml:12: attach left out");
  CHECK(oracle_notes_explain(&notes, "mass", "leg"));
  oracle_notes_free(&notes);
}
