/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/touches.h>

#include "session/session_internal.h"

hap_status hap_pointer_touches(hap_session *session, hap_pointer_id pointer, hap_touch *touches,
                               size_t capacity, size_t size_of_touch, size_t *out_count)
{
  if (session == NULL || touches == NULL || out_count == NULL ||
      size_of_touch < sizeof touches->geom) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  return hapi_session_say(
      session,
      hapi_haptic_touches(session->haptic, pointer, touches, capacity, size_of_touch, out_count),
      __func__);
}

hap_status hap_session_contacts(hap_session *session, hap_body_contact *contacts, size_t capacity,
                                size_t size_of_contact, size_t *out_count)
{
  if (session == NULL || contacts == NULL || out_count == NULL ||
      size_of_contact < sizeof contacts->geom_a) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  return hapi_haptic_contacts(session->haptic, contacts, capacity, size_of_contact, out_count);
}

hap_status hap_session_events(hap_session *session, hap_event *events, size_t capacity,
                              size_t size_of_event, size_t *out_count)
{
  if (session == NULL || events == NULL || out_count == NULL ||
      size_of_event < offsetof(hap_event, pointer)) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  *out_count = hapi_haptic_read_events(session->haptic, events, capacity, size_of_event);
  return *out_count == 0 ? HAP_END : HAP_OK;
}

const char *hap_event_name(hap_event_kind kind)
{
  static const char *const names[] = {
      [HAP_EVENT_TOUCH] = "touch",         [HAP_EVENT_RELEASE] = "release",
      [HAP_EVENT_SLIDE] = "slide",         [HAP_EVENT_STICK] = "stick",
      [HAP_EVENT_IMPACT] = "impact",       [HAP_EVENT_BUTTON] = "button",
      [HAP_EVENT_FAULT] = "fault",         [HAP_EVENT_GRIPPER] = "gripper",
      [HAP_EVENT_FORCE_OUT] = "force-out", [HAP_EVENT_HOLD] = "hold",
      [HAP_EVENT_LET_GO] = "let-go",       [HAP_EVENT_TEXTURE_OUT] = "texture-out",
  };
  size_t at = (size_t)kind;
  return at < sizeof names / sizeof names[0] ? names[at] : NULL;
}
