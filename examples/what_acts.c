/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/hapode.h>
#include <stdio.h>

/* What each effect does, and why. */
static hap_status effects_print(const hap_session *session)
{
  static const char *const states[] = {"off", "on", "partly on"};
  hap_effect_info info[HAP_EFFECTS];
  hap_status status = hap_session_effects(session, info, HAP_EFFECTS, sizeof info[0]);
  for (int i = 0; i < HAP_EFFECTS && status >= HAP_OK; ++i) {
    hap_effect effect = (hap_effect)info[i].effect;
    printf("  %-11s %-4s  %s: %s (%s)\n", hap_effect_name(effect),
           hap_effect_wish_name((hap_effect_wish)info[i].wish),
           info[i].state < 3 ? states[info[i].state] : "?",
           hap_effect_reason_text((hap_effect_reason)info[i].reason), hap_effect_text(effect));
  }
  return status;
}

/* A wish, unless the model cannot fulfil it. */
static hap_status wish_set(hap_session *session, hap_effect effect, hap_effect_wish wish,
                           hap_model model)
{
  hap_detail remedy = {""};
  if (hap_effect_check(effect, wish, model, &remedy) < HAP_OK) {
    printf("%s=%s in model %s: %s\n", hap_effect_name(effect), hap_effect_wish_name(wish),
           hap_model_name(model), remedy.text);
    return HAP_OK;
  }
  return hap_session_set_effect(session, effect, wish);
}

int main(int argc, char **argv)
{
  hap_detail why = {""};
  hap_scene *scene;
  hap_session *session;
  hap_session_def def;
  hap_pointer_def hand;
  const char *device;
  printf("hapode %s\n", hap_version());
  hap_session_def_init(&def, sizeof def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  hap_pointer_def_init(&hand, sizeof hand);
  if (hap_scene_load(argc > 1 ? argv[1] : "row10:3", &scene, &why) < HAP_OK ||
      hap_scene_hand(scene, 0, &hand, &device) < HAP_OK ||
      hap_device_open(device, &hand.device, &why) < HAP_OK ||
      hap_scene_session(scene, &def, &session, &why) < HAP_OK ||
      hap_pointer_add(session, &hand, &(hap_pointer_id){0}) < HAP_OK ||
      hap_session_start(session) < HAP_OK || hap_session_advance(session, 500) < HAP_OK) {
    return fprintf(stderr, "%s\n", why.text), 1;
  }
  puts("as the scene needs it:");
  if (effects_print(session) < HAP_OK ||
      wish_set(session, HAP_EFFECT_GYRO, HAP_EFFECT_ON, def.model) < HAP_OK ||
      wish_set(session, HAP_EFFECT_CROSS, HAP_EFFECT_ON, def.model) < HAP_OK ||
      hap_session_advance(session, 100) < HAP_OK) {
    return 1;
  }
  puts("as wished:");
  if (effects_print(session) < HAP_OK) {
    return 1;
  }
  hap_session_destroy(session);
  hap_device_close(hand.device);
  return hap_scene_destroy(scene) < HAP_OK;
}
