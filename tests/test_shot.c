/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-run --shot and --frames as their users meet them. HAPODE_RUN: path of the program. */

#include <png.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/program.h"
#include "tests/tap.h"

#include <hapode/scene.h>

/* A picture that was read. */
typedef struct picture {
  int width;
  int height;
  uint8_t *pixels; /* 3 bytes each; owned by the test */
} picture;

/* Nothing but memory, which tap_own frees. */
static void pixels_finish(void *owned)
{
  (void)owned;
}

static picture picture_read(const char *path)
{
  png_image image;
  memset(&image, 0, sizeof image);
  image.version = PNG_IMAGE_VERSION;
  REQUIRE_SAY(png_image_begin_read_from_file(&image, path) != 0, "%s: %s", path, image.message);
  image.format = PNG_FORMAT_RGB;
  picture out = {(int)image.width, (int)image.height,
                 tap_own(PNG_IMAGE_SIZE(image), pixels_finish)};
  REQUIRE(png_image_finish_read(&image, NULL, out.pixels, 0, NULL) != 0);
  return out;
}

/* Leaves the test where nothing can draw. */
static void drawing_require(void)
{
  int code = run("--lockstep --seconds 0.002 --shot %s", folder_path("try.png"));
  if (code == 2 && strstr(ran.err, "EGL") != NULL) {
    SKIP("%.*s", (int)strcspn(ran.err, "\n"), ran.err);
  }
  REQUIRE(code == 0);
}

static const char *hash_of(void)
{
  static char hashes[2][40];
  static int next;
  char *hash = hashes[next++ % 2];
  const char *line = strstr(ran.out, "trace_hash: ");
  REQUIRE(line != NULL);
  snprintf(hash, sizeof hashes[0], "%.30s", line);
  hash[strcspn(hash, "\n")] = '\0';
  return hash;
}

static int reds_of(const picture *p)
{
  int reds = 0;
  for (int i = 0; i < p->width * p->height; ++i) {
    const uint8_t *c = &p->pixels[3 * i];
    reds += c[0] > 110 && c[0] > 2 * c[1] && c[0] > 2 * c[2];
  }
  return reds;
}

/* Of the files of a test, whose names folder_path has for eight calls only. */
static const char *path_keep(const char *name)
{
  static char paths[4][300];
  static int next;
  char *path = paths[next++ % 4];
  snprintf(path, sizeof paths[0], "%s", folder_path(name));
  return path;
}

/* Share of the pixels in the middle of the picture that differ much from the next one: edges of
 * bodies and shadows. Floor, sky and the lines of the grid have next to none. */
static double picture_variety(const picture *p)
{
  double sum = 0.0;
  for (int y = p->height / 4; y < p->height * 3 / 4; ++y) {
    for (int x = p->width / 5; x < p->width * 4 / 5; ++x) {
      const uint8_t *c = &p->pixels[3 * (y * p->width + x)];
      sum += abs(c[0] - c[3]) + abs(c[1] - c[4]) + abs(c[2] - c[5]) > 60;
    }
  }
  return sum / (0.5 * 0.6 * p->width * p->height);
}

TEST(a_shot_changes_nothing)
{
  drawing_require();
  const char *const scenes[] = {"row10", "lightstand", "grasp", "peg"};
  for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; ++i) {
    REQUIRE(run("--scene %s --lockstep --seconds 0.4", scenes[i]) == 0);
    const char *without = hash_of();
    REQUIRE(run("--scene %s --lockstep --seconds 0.4 --shot-size 320x320 --shot %s --frames %s",
                scenes[i], folder_path("same.png"), folder_path("same")) == 0);
    CHECK_SAY(strcmp(without, hash_of()) == 0, "%s", scenes[i]);
  }
}

TEST(every_scene_has_a_picture)
{
  const char *name;
  drawing_require();
  for (size_t i = 0; (name = hap_scene_name_at(i, NULL)) != NULL; ++i) {
    const char *path = path_keep("scene.png");
    REQUIRE_SAY(
        run("--scene %s --lockstep --seconds 0.2 --shot-size 640x360 --shot %s", name, path) == 0,
        "%s: %s", name, ran.err);
    picture p = picture_read(path);
    CHECK(p.width == 640 && p.height == 360);
    double share = picture_variety(&p);
    CHECK_SAY(share > 0.002 && share < 0.3, "%s: %g", name, share);
    CHECK_SAY(strcmp(name, "field") == 0 || reds_of(&p) > 10, "%s: no pointer", name);
    tap_release(p.pixels);
  }
}

TEST(a_time_can_be_chosen)
{
  drawing_require();
  const char *early = path_keep("early.png");
  const char *late = path_keep("late.png");
  const char *options = "--lockstep --scene slide --shot-size 640x360 --camera=0,-0.5,0.2,0,0,0.02";
  REQUIRE(run("%s --shot-at 0 --shot %s", options, early) == 0);
  REQUIRE(run("%s --shot-at 1.9 --shot %s", options, late) == 0);
  picture pictures[2] = {picture_read(early), picture_read(late)};
  double middle[2] = {0.0, 0.0};
  for (int i = 0; i < 2; ++i) { /* of the red pointer, which goes to the right by 0.1 m */
    int count = 0;
    for (int k = 0; k < 640 * 280; ++k) {
      const uint8_t *c = &pictures[i].pixels[3 * k];
      if (c[0] > 110 && c[0] > 2 * c[1] && c[0] > 2 * c[2]) {
        middle[i] += k % 640;
        ++count;
      }
    }
    REQUIRE(count > 50);
    middle[i] /= count;
  }
  CHECK_SAY(middle[1] > middle[0] + 80, "%g, then %g", middle[0], middle[1]);
}

TEST(frames_come_thirty_times_a_second)
{
  drawing_require();
  const char *folder = path_keep("frames");
  char path[300];
  REQUIRE(run("--lockstep --seconds 0.5 --shot-size 320x320 --frames %s", folder) == 0);
  for (int i = 0; i < 15; ++i) {
    snprintf(path, sizeof path, "%s/frame_%05d.png", folder, i);
    CHECK(picture_read(path).width == 320);
  }
  snprintf(path, sizeof path, "%s/frame_00016.png", folder);
  CHECK(!file_exists(path));
}

/* Of the yellow of touches, on ground that is not. */
static int yellows_of(const picture *p)
{
  int count = 0;
  for (int i = 0; i < p->width * p->height * 3 / 4; ++i) {
    const uint8_t *c = &p->pixels[3 * i];
    count += c[0] > 150 && c[1] > 0.82 * c[0] && c[2] < 0.45 * c[1];
  }
  return count;
}

/* In real time, which a machine with other work may not keep: then once more, and again. */
static bool recording_make(const char *what, const char *path)
{
  bool made = false;
  for (int i = 0; i < 3 && !made; ++i) {
    made = run("%s --no-realtime --record %s", what, path) == 0;
  }
  return made;
}

TEST(a_recording_shows_where_it_was_touched)
{
  drawing_require();
  const char *recording = path_keep("run.rec");
  const char *path = path_keep("played.png");
  REQUIRE(recording_make("--scene field --seconds 2", recording));
  REQUIRE(run("--play %s --shot-size 640x360 --shot %s", recording, path) == 0);
  picture p = picture_read(path);
  CHECK_SAY(yellows_of(&p) > 50, "%d", yellows_of(&p));
}

TEST(a_recording_has_pictures)
{
  drawing_require();
  const char *recording = path_keep("run.rec");
  const char *path = path_keep("played.png");
  REQUIRE(recording_make("--scene row10:3 --seconds 0.8", recording));
  REQUIRE(run("--play %s --shot-size 640x360 --shot %s", recording, path) == 0);
  CHECK(strstr(ran.out, "replay: identical") != NULL);
  picture p = picture_read(path);
  CHECK(reds_of(&p) > 100);
  double share = picture_variety(&p);
  CHECK_SAY(share > 0.002, "%g", share);
}

TEST(what_cannot_be_written_is_said)
{
  drawing_require();
  CHECK(run("--lockstep --seconds 0.01 --shot /nowhere/x.png") == 1);
  CHECK(says("--shot /nowhere/x.png: cannot be written"));
  CHECK(run("--lockstep --seconds 0.01 --shot /dev/full") == 1);
  CHECK(says("--shot /dev/full: cannot be written") && says("space"));
  CHECK(run("--lockstep --seconds 0.01 --frames /dev/null") == 1);
  CHECK(says("--frames /dev/null: cannot be a folder"));
}

TEST(without_a_driver_a_sentence_says_so)
{
  drawing_require();
  setenv("__EGL_VENDOR_LIBRARY_DIRS", folder_path("no_drivers"), 1);
  int code = run("--lockstep --seconds 0.01 --shot %s", folder_path("never.png"));
  unsetenv("__EGL_VENDOR_LIBRARY_DIRS");
  if (code == 0) {
    SKIP("EGL here does not ask for the folder of its drivers");
  }
  CHECK(code == 2);
  CHECK(says("pictures need EGL with OpenGL 3.3"));
  CHECK(!file_exists(folder_path("never.png")));
}

TEST(wrong_usage_is_refused)
{
  const struct {
    const char *arguments;
    const char *text;
  } cases[] = {{"--shot a.png --camera 1,2,3", "x,y,z,tx,ty,tz"},
               {"--shot a.png --camera 1,2,3,1,2,3", "apart"},
               {"--camera 1,2,3,0,0,0", "only with --shot"},
               {"--shot-at 1", "only with --shot"},
               {"--shot a.png --shot-size 100x400", "320 to 8192"},
               {"--shot a.png --shot-size 640", "WIDTHxHEIGHT"},
               {"--shot a.png --trace a.png", "same file"},
               {"--shot a.png --check-device virtual", "no scene"}};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    CHECK_SAY(run("%s", cases[i].arguments) == 2, "%s", cases[i].arguments);
    CHECK(says(cases[i].text));
  }
}

SET_UP
{
  return program_use("HAPODE_RUN");
}
