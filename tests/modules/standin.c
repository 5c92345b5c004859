/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "standin.h"

#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "standin_inner.h"

static standin in_memory;
static standin *it;
static pthread_once_t once = PTHREAD_ONCE_INIT;

static void standin_make(void)
{
  const char *path = getenv("STANDIN_FILE");
  const char *swings = getenv("STANDIN_SWING");
  int file = path != NULL ? open(path, O_RDWR | O_CREAT, 0600) : -1;
  it = &in_memory;
  if (file >= 0 && ftruncate(file, (off_t)sizeof *it) == 0) {
    void *mapped = mmap(NULL, sizeof *it, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    it = mapped != MAP_FAILED ? mapped : it;
  }
  atomic_store(&it->count, 1);
  atomic_store(&it->hz, 1.0);
  atomic_store(&it->wrist, 1);
  if (swings != NULL) {
    atomic_store(&it->of[0].swing[0], 0.01);
    atomic_store(&it->of[0].swing[2], 0.02);
  }
}

standin *standin_get(void)
{
  pthread_once(&once, standin_make);
  return it;
}

double standin_seconds(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void standin_sleep_ms(double ms)
{
  const struct timespec length = {(time_t)(1e-3 * ms),
                                  (long)(1e6 * (ms - 1e3 * (double)(time_t)(1e-3 * ms)))};
  nanosleep(&length, NULL);
}

void standin_motion(int id, double position[3], double velocity[3])
{
  double w = 2.0 * M_PI * atomic_load(&standin_get()->hz);
  double t = standin_seconds();
  standin_device *device = &standin_get()->of[id];
  for (int i = 0; i < 3; ++i) {
    double swing = atomic_load(&device->swing[i]);
    position[i] = atomic_load(&device->position[i]) + swing * sin(w * t);
    velocity[i] = w * swing * cos(w * t);
  }
}

/* Rodrigues. */
void standin_rotation(int id, double r[3][3])
{
  standin_device *device = &standin_get()->of[id];
  double v[3] = {atomic_load(&device->turn[0]), atomic_load(&device->turn[1]),
                 atomic_load(&device->turn[2])};
  double angle = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  double s = angle > 0.0 ? sin(angle) / angle : 1.0;
  double c = angle > 0.0 ? (1.0 - cos(angle)) / (angle * angle) : 0.5;
  const double cross[3][3] = {{0, -v[2], v[1]}, {v[2], 0, -v[0]}, {-v[1], v[0], 0}};
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      double square = 0.0;
      for (int j = 0; j < 3; ++j) {
        square += cross[i][j] * cross[j][k];
      }
      r[i][k] = (i == k ? 1.0 : 0.0) + s * cross[i][k] + c * square;
    }
  }
}

void standin_force(int id, const double force[3], const double torque[3])
{
  standin_device *device = &standin_get()->of[id];
  int push = 0;
  for (int i = 0; i < 3; ++i) {
    push |= force[i] != 0.0 || torque[i] != 0.0;
    if (!isfinite(force[i]) || !isfinite(torque[i])) {
      atomic_fetch_add(&standin_get()->misuse, 1);
    }
    atomic_store(&device->force[i], force[i]);
    atomic_store(&device->torque[i], torque[i]);
  }
  atomic_fetch_add(&device->pushes, (uint64_t)push);
  atomic_fetch_add(&device->forces, 1);
}

int standin_fault_of(int id)
{
  standin_device *device = &standin_get()->of[id];
  while (atomic_load(&device->fault) == STANDIN_HANGS) {
    standin_sleep_ms(1.0);
  }
  return atomic_load(&device->fault);
}
