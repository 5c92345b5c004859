/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A device that moves as a recording says, whatever force it is given. */

#include <hapode/device_impl.h>

#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/vec.h"
#include "plugins/common/arguments.h"
#include "plugins/common/output.h"
#include "plugins/common/timeline.h"
#include "plugins/replay/recording.h"
#include "plugins/replay/spline.h"

#define MAX_FORCE 20.0 /* N */
#define MAX_TORQUE 1.0 /* N m */

typedef struct replay_device {
  hapi_recording recording;
  size_t segment; /* where the newest read was */
  double scale;
  double offset[3];
  double rotate[4];
  double start; /* s of the recording's clock at the first read */
  hapi_output output;
  hapi_timeline timeline;
} replay_device;

enum argument {
  SCALE,
  OFFSET,
  ROTATE,
  START,
  ARGUMENT_COUNT
};

static const hapi_argument known_arguments[ARGUMENT_COUNT] = {
    [SCALE] = {"scale", HAPI_ARGUMENT_NUMBER, false, 1e-6, 1e6, "a number from 1e-6 to 1e6",
               .number = {1.0}},
    [OFFSET] = {"offset", HAPI_ARGUMENT_VECTOR, false, -1e6, 1e6, "x/y/z in m, each within 1e6"},
    [ROTATE] = {"rotate", HAPI_ARGUMENT_QUATERNION, .expected = "w/x/y/z, not all zero",
                .number = {1.0}},
    [START] = {"start", HAPI_ARGUMENT_NUMBER, false, 0.0, 1e10, "seconds from 0 to 1e10"},
};

static hap_status read_arguments(replay_device *device, const char *args, hap_detail *detail)
{
  hapi_argument entries[ARGUMENT_COUNT];
  memcpy(entries, known_arguments, sizeof entries);
  hapi_argument_table table = {"replay", entries, ARGUMENT_COUNT};
  hap_status status = hapi_arguments_read(&table, args, detail);
  if (status < 0) {
    return status;
  }
  device->scale = entries[SCALE].number[0];
  device->start = entries[START].number[0];
  hapi_v3_copy(entries[OFFSET].number, device->offset);
  memcpy(device->rotate, entries[ROTATE].number, sizeof device->rotate);
  return HAP_OK;
}

static hap_status recording_load(replay_device *device, const char *name, size_t length,
                                 hap_detail *detail)
{
  char *path = hapi_alloc(length + 1);
  if (path == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "replay: out of memory");
  }
  memcpy(path, name, length);
  hap_status status = hapi_recording_load(&device->recording, path, detail);
  hapi_free(path);
  return status < 0 ? status : hapi_spline_solve(&device->recording, detail);
}

static hap_status device_configure(replay_device *device, const char *args, hap_detail *detail)
{
  size_t length = strcspn(args, ",");
  if (length == 0) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "replay: expected a file name: replay:FILE[,scale=S][,offset=x/y/z]"
                     "[,rotate=w/x/y/z][,start=S]");
  }
  if (args[length] == ',' && args[length + 1] == '\0') {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "replay: nothing follows the last comma");
  }
  const char *rest = args[length] == ',' ? args + length + 1 : "";
  hap_status status = read_arguments(device, rest, detail);
  if (status < 0) {
    return status;
  }
  status = recording_load(device, args, length, detail);
  hapi_output_init(&device->output, MAX_FORCE, device->recording.channels == 7 ? MAX_TORQUE : 0.0);
  return status;
}

static void replay_close(void *self)
{
  replay_device *device = self;
  hapi_recording_finish(&device->recording);
  hapi_free(device);
}

static hap_status replay_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  replay_device *device = hapi_alloc(sizeof *device);
  if (device == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "replay: out of memory");
  }
  hap_status status = device_configure(device, args, detail);
  if (status < 0) {
    replay_close(device);
    return status;
  }
  *self = device;
  return HAP_OK;
}

static void replay_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)effector;
  const replay_device *device = self;
  out->dof = device->recording.channels == 7 ? 6 : 3;
  out->measures_velocity = 1; /* the slope of the spline */
  out->max_force = device->output.max_force;
  out->max_torque = device->output.max_torque;
}

static hap_status replay_start(void *self)
{
  replay_device *device = self;
  hapi_output_zero(&device->output);
  hapi_timeline_start(&device->timeline);
  device->segment = 0;
  return HAP_OK;
}

/* Channels and derivatives; outside of the recording at rest at its ends. */
static void channels_sample(replay_device *device, double time, double *value, double *slope)
{
  const hapi_recording *recording = &device->recording;
  const double *first = hapi_recording_row(recording, 0);
  const double *last = hapi_recording_row(recording, recording->count - 1);
  size_t bytes = (size_t)recording->channels * sizeof(double);
  if (recording->count == 1 || time < first[0] || time > last[0]) {
    memcpy(value, time > last[0] ? last + 1 : first + 1, bytes);
    memset(slope, 0, bytes);
    return;
  }
  device->segment = hapi_spline_find(recording, time, device->segment);
  hapi_spline_at(recording, device->segment, time, value, slope);
}

/* The unit quaternion along a spline that is not one, and the angular velocity in the axes of the
 * fixed frame: omega = 2 q' q*. The part of q' along q is real and drops out. */
static void settle_rotation(const double value[4], const double slope[4], double quat[4],
                            double angular[3])
{
  memcpy(quat, value, 4 * sizeof quat[0]);
  hapi_quat_normalize(quat);
  double length = quat[0] * value[0] + quat[1] * value[1] + quat[2] * value[2] + quat[3] * value[3];
  if (!(length > 1e-3)) {
    hapi_v3_set(angular, 0.0, 0.0, 0.0); /* half a turn from row to row: no direction to tell */
    return;
  }
  double back[4] = {quat[0], -quat[1], -quat[2], -quat[3]};
  double rate[4];
  hapi_quat_multiply(slope, back, rate);
  hapi_v3_scale(2.0 / length, rate + 1, angular);
}

static void pose_place(const replay_device *device, const double *value, const double *slope,
                       hap_pose *pose, hap_twist *twist)
{
  hapi_v3_scale(device->scale, value, pose->position);
  hapi_quat_rotate(device->rotate, pose->position, pose->position);
  hapi_v3_add(pose->position, device->offset, pose->position);
  hapi_v3_scale(device->scale, slope, twist->linear);
  hapi_quat_rotate(device->rotate, twist->linear, twist->linear);
  if (device->recording.channels != 7) {
    memcpy(pose->quat_wxyz, device->rotate, sizeof pose->quat_wxyz);
    hapi_v3_set(twist->angular, 0.0, 0.0, 0.0);
    return;
  }
  double quat[4];
  settle_rotation(value + 3, slope + 3, quat, twist->angular);
  hapi_quat_multiply(device->rotate, quat, pose->quat_wxyz);
  hapi_quat_rotate(device->rotate, twist->angular, twist->angular);
}

static hap_status replay_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  replay_device *device = self;
  hap_status status = hapi_timeline_advance(&device->timeline, time_ns);
  if (status < 0) {
    return status;
  }
  double value[HAPI_RECORDING_CHANNELS_MAX];
  double slope[HAPI_RECORDING_CHANNELS_MAX];
  channels_sample(device, device->start + hapi_timeline_seconds(device->timeline.elapsed_ns), value,
                  slope);
  pose_place(device, value, slope, &in->pose, &in->twist);
  in->buttons = 0;
  return HAP_OK;
}

static hap_status replay_write(void *self, const hap_device_output *const wanted[],
                               hap_device_output *const reached[])
{
  replay_device *device = self;
  if (!device->timeline.running) {
    return HAP_ERROR_STATE;
  }
  return hapi_output_write(&device->output, &wanted[0]->wrench, &reached[0]->wrench);
}

static void replay_zero(void *self)
{
  replay_device *device = self;
  hapi_output_zero(&device->output);
}

static void replay_stop(void *self)
{
  replay_device *device = self;
  hapi_output_zero(&device->output);
  hapi_timeline_stop(&device->timeline);
}

static void replay_held(void *self, hap_device_output *const out[])
{
  const replay_device *device = self;
  hapi_output_get(&device->output, &out[0]->wrench);
}

const hap_device_ops hapi_replay_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "replay",
    .help =
        "a recorded motion: FILE[,scale=S][,offset=x/y/z][,rotate=w/x/y/z][,start=S], FILE a CSV "
        "of t,x,y,z[,qw,qx,qy,qz] in SI units with a header line",
    .pacing = HAP_PACING_VIRTUAL,
    .open = replay_open,
    .describe = replay_describe,
    .start = replay_start,
    .read = replay_read,
    .write = replay_write,
    .zero = replay_zero,
    .stop = replay_stop,
    .close = replay_close,
    .held = replay_held,
};
