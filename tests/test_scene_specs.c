/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What scenes are built from: names, numbers of bodies, changed parameters. */

#include <scenes/scenes.h>
#include <tests/tap.h>

static const scene_parameters *row_of(const char *name)
{
  for (size_t i = 0; scene_table_at(i) != NULL; ++i) {
    if (strcmp(scene_table_at(i)->name, name) == 0) {
      return scene_table_at(i);
    }
  }
  return NULL;
}

/* Every scene's name is in the text. */
static void check_lists_all(const char *text)
{
  CHECK(strlen(text) + 1 < sizeof((hap_detail *)0)->text);
  for (size_t i = 0; scene_table_at(i) != NULL; ++i) {
    CHECK(strstr(text, scene_table_at(i)->name) != NULL);
  }
}

TEST(bad_specs_are_refused_with_a_list)
{
  const char *specs[] = {"",         "nosuch",         "fig",
                         "fig55",    "row10:0",        "row10:x",
                         "row10:",   "row10:-1",       "row10:3x",
                         "row10: 3", "slide:3",        "fig5:",
                         ":3",       "pile:999999999", "pile:10001",
                         "door:1",   "FIG5",           "fig7:99999999999999999999999999",
                         NULL};
  for (size_t i = 0; i < sizeof specs / sizeof specs[0]; ++i) {
    hap_detail detail = {""};
    scene *s = (scene *)&detail;
    CHECK(scene_create(specs[i], &s, &detail) < 0);
    CHECK(s == NULL);
    check_lists_all(detail.text);
    CHECK(scene_create(specs[i], &s, NULL) < 0);
  }
  scene *s = NULL;
  CHECK(scene_create("nosuch", &s, NULL) == HAP_ERROR_NOT_FOUND);
  CHECK(scene_create("slide:3", &s, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(scene_create("slide", NULL, NULL) == HAP_ERROR_ARGUMENT);
}

TEST(long_names_do_not_cut_the_list)
{
  char name[2000];
  memset(name, 'a', sizeof name);
  name[sizeof name - 1] = '\0';
  hap_detail detail = {""};
  scene *s = NULL;
  CHECK(scene_create(name, &s, &detail) == HAP_ERROR_NOT_FOUND);
  check_lists_all(detail.text);
  memcpy(name, "pile:", 5);
  CHECK(scene_create(name, &s, &detail) == HAP_ERROR_ARGUMENT);
  check_lists_all(detail.text);
  scene_parameters p = *scene_table_at(0);
  p.name = name;
  CHECK(scene_create_from(&p, 0, &s, &detail) == HAP_ERROR_NOT_FOUND);
  check_lists_all(detail.text);
}

TEST(edited_parameters_are_used)
{
  REQUIRE(row_of("slide") != NULL);
  scene_parameters p = *row_of("slide");
  scene *s = NULL;
  dMass mass;
  p.mass = 3;
  p.gravity = 1.6;
  p.iterations = 77;
  p.hands[0] = "virtual:path=0:0/0/1";
  REQUIRE(scene_create_from(&p, 0, &s, NULL) == HAP_OK);
  dBodyGetMass(s->bodies[0], &mass);
  dVector3 g;
  dWorldGetGravity(s->world, g);
  CHECK(mass.mass == 3 && g[2] == -1.6 && s->count == 0);
  CHECK(dWorldGetQuickStepNumIterations(s->world) == 77);
  CHECK(s->parameters.hands[0] == p.hands[0]);
  scene_destroy(s);
}

static void check_refused(scene_parameters p, int count)
{
  hap_detail detail = {""};
  scene *s = NULL;
  CHECK(scene_create_from(&p, count, &s, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(s == NULL);
  CHECK(detail.text[0] != '\0');
}

TEST(a_copied_row_may_have_an_n_of_its_own)
{
  REQUIRE(row_of("slide") != NULL && row_of("fig7") != NULL);
  scene_parameters p = *row_of("fig7");
  scene *s = NULL;
  p.count_default = 3;
  REQUIRE(scene_create_from(&p, 0, &s, NULL) == HAP_OK);
  CHECK(s->count == 3 && s->body_count == 3);
  scene_destroy(s);
  REQUIRE(scene_create_from(&p, 4, &s, NULL) == HAP_OK);
  CHECK(s->count == 4 && s->body_count == 4);
  scene_destroy(s);
  for (p.count_default = -1; p.count_default < 1; ++p.count_default) {
    check_refused(p, 0);
  }
  p.count_default = 1000000;
  check_refused(p, 0);
  p = *row_of("slide");
  p.count_default = 2;
  check_refused(p, 0);
}

TEST(bad_parameters_are_refused)
{
  REQUIRE(row_of("slide") != NULL && row_of("fig7") != NULL);
  const scene_parameters good = *row_of("slide");
  const double bad[] = {-1, NAN, INFINITY};
  for (size_t i = 0; i < 3; ++i) {
    scene_parameters p = good;
    p.mass = bad[i];
    check_refused(p, 0);
    p = good;
    p.size = bad[i];
    check_refused(p, 0);
    p = good;
    p.duration = bad[i];
    check_refused(p, 0);
    p = good;
    p.gap = bad[i];
    check_refused(p, 0);
    p = good;
    p.shift[1] = i == 0 ? -1e4 : bad[i];
    check_refused(p, 0);
    if (!isinf(bad[i])) { /* infinite friction is allowed */
      p = good;
      p.mu = bad[i];
      check_refused(p, 0);
    }
  }
  scene_parameters p = good;
  p.pointers = SCENE_POINTERS_MAX + 1;
  check_refused(p, 0);
  p = good;
  p.pointers = 2; /* and only one hand */
  check_refused(p, 0);
  p = good;
  p.iterations = 0;
  check_refused(p, 0);
  check_refused(good, 1);
  check_refused(*row_of("fig7"), -1);
  check_refused(*row_of("fig7"), 999999999);
  p = good;
  p.name = NULL;
  check_refused(p, 0);
}

TEST(destroy_accepts_null)
{
  scene_destroy(NULL);
  CHECK(scene_table_at(1000) == NULL);
}
