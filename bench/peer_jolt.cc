/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Jolt: sequential impulses with positions apart, one thread. The floor is a box. Its lengths of
 * slop, manifolds and speculation are for things of a metre: here for cubes of 5 cm. */

#include <Jolt/Jolt.h>

#include <Jolt/Core/Factory.h>
#include <Jolt/Core/JobSystemSingleThreaded.h>
#include <Jolt/Core/TempAllocator.h>
#include <Jolt/Physics/Body/BodyCreationSettings.h>
#include <Jolt/Physics/Collision/BroadPhase/BroadPhaseLayerInterfaceTable.h>
#include <Jolt/Physics/Collision/BroadPhase/ObjectVsBroadPhaseLayerFilterTable.h>
#include <Jolt/Physics/Collision/ObjectLayerPairFilterTable.h>
#include <Jolt/Physics/Collision/Shape/BoxShape.h>
#include <Jolt/Physics/Collision/Shape/MeshShape.h>
#include <Jolt/Physics/Constraints/HingeConstraint.h>
#include <Jolt/Physics/Constraints/PointConstraint.h>
#include <Jolt/Physics/PhysicsSystem.h>
#include <Jolt/RegisterTypes.h>

#include <mutex>
#include <vector>

#include "bench/peer.h"

namespace {

constexpr float floor_half = 10.0F;          /* m */
constexpr float edge_round = 1e-3F;          /* m, convex radius of boxes */
constexpr float touch_ahead = 1e-3F;         /* m */
constexpr float flat_within = 1e-4F;         /* m, of a manifold */
constexpr JPH::uint step_memory = 64U << 20; /* bytes, of a step */
constexpr JPH::uint pairs_most = 65536;
constexpr JPH::ObjectLayer layer_fixed = 0;
constexpr JPH::ObjectLayer layer_boxes = 1;
constexpr JPH::uint layer_count = 2;

struct jolt_layers {
  JPH::BroadPhaseLayerInterfaceTable broad{layer_count, layer_count};
  JPH::ObjectLayerPairFilterTable pairs{layer_count};

  explicit jolt_layers(bool boxes_pass)
  {
    broad.MapObjectToBroadPhaseLayer(layer_fixed, JPH::BroadPhaseLayer(0));
    broad.MapObjectToBroadPhaseLayer(layer_boxes, JPH::BroadPhaseLayer(1));
    pairs.EnableCollision(layer_fixed, layer_boxes);
    if (!boxes_pass) {
      pairs.EnableCollision(layer_boxes, layer_boxes);
    }
  }
};

struct jolt_sim {
  jolt_layers layers;
  JPH::ObjectVsBroadPhaseLayerFilterTable filter;
  JPH::TempAllocatorImpl memory{step_memory};
  JPH::JobSystemSingleThreaded jobs{JPH::cMaxPhysicsJobs};
  JPH::PhysicsSystem system;
  std::vector<JPH::BodyID> bodies;
  float step_s = 0.0F;

  explicit jolt_sim(bool boxes_pass)
      : layers(boxes_pass), filter(layers.broad, layer_count, layers.pairs, layer_count)
  {
  }
};

JPH::Vec3 vector_of(const double v[3])
{
  return JPH::Vec3(float(v[0]), float(v[1]), float(v[2]));
}

void types_register()
{
  static std::once_flag once;
  std::call_once(once, [] {
    JPH::RegisterDefaultAllocator();
    JPH::Factory::sInstance = new JPH::Factory();
    JPH::RegisterTypes();
  });
}

void fixed_add(jolt_sim *sim, const peer_world *world, const JPH::Shape *shape, JPH::Vec3 at)
{
  JPH::BodyCreationSettings settings(shape, JPH::RVec3(at), JPH::Quat::sIdentity(),
                                     JPH::EMotionType::Static, layer_fixed);
  settings.mFriction = float(world->mu); /* of a pair: the geometric mean */
  sim->system.GetBodyInterface().CreateAndAddBody(settings, JPH::EActivation::DontActivate);
}

bool ground_add(jolt_sim *sim, const peer_world *world)
{
  const peer_ground *g = &world->ground;
  const double *v = g->vertices;
  const unsigned *index = g->indices;
  JPH::VertexList corners;
  JPH::IndexedTriangleList triangles;
  for (size_t i = 0; i < g->vertex_count; ++i, v += 3) {
    corners.push_back(JPH::Float3(float(v[0]), float(v[1]), float(v[2])));
  }
  for (size_t i = 0; i < g->triangle_count; ++i, index += 3) {
    triangles.push_back(JPH::IndexedTriangle(index[0], index[1], index[2], 0));
  }
  JPH::Shape::ShapeResult shape =
      JPH::MeshShapeSettings(std::move(corners), std::move(triangles)).Create();
  if (shape.IsValid()) {
    fixed_add(sim, world, shape.Get(), JPH::Vec3::sZero());
  }
  return shape.IsValid();
}

void boxes_add(jolt_sim *sim, const peer_world *world)
{
  for (size_t i = 0; i < world->count; ++i) {
    const peer_box *box = &world->boxes[i];
    JPH::BodyCreationSettings settings(new JPH::BoxShape(0.5F * vector_of(box->edges), edge_round),
                                       JPH::RVec3(vector_of(box->at)), JPH::Quat::sIdentity(),
                                       JPH::EMotionType::Dynamic, layer_boxes);
    settings.mOverrideMassProperties = JPH::EOverrideMassProperties::CalculateInertia;
    settings.mMassPropertiesOverride.mMass = float(box->mass);
    settings.mFriction = float(world->mu);
    settings.mLinearDamping = 0.0F;
    settings.mAngularDamping = 0.0F;
    sim->bodies.push_back(
        sim->system.GetBodyInterface().CreateAndAddBody(settings, JPH::EActivation::Activate));
  }
}

template <typename Settings>
void joint_add(jolt_sim *sim, const peer_joint *joint, Settings *made)
{
  JPH::BodyID parent = joint->parent < 0 ? JPH::BodyID() : sim->bodies[size_t(joint->parent)];
  JPH::BodyID child = sim->bodies[size_t(joint->child)];
  sim->system.AddConstraint(sim->system.GetBodyInterface().CreateConstraint(made, parent, child));
}

void joint_make(jolt_sim *sim, const peer_joint *joint)
{
  JPH::RVec3 anchor(vector_of(joint->anchor));
  if (joint->kind == PEER_BALL) {
    JPH::PointConstraintSettings ball;
    ball.SetEmbedded();
    ball.mPoint1 = ball.mPoint2 = anchor;
    joint_add(sim, joint, &ball);
    return;
  }
  JPH::HingeConstraintSettings hinge;
  hinge.SetEmbedded();
  hinge.mPoint1 = hinge.mPoint2 = anchor;
  hinge.mHingeAxis1 = hinge.mHingeAxis2 = vector_of(joint->axis);
  hinge.mNormalAxis1 = hinge.mNormalAxis2 = vector_of(joint->axis).GetNormalizedPerpendicular();
  joint_add(sim, joint, &hinge);
}

void settings_set(jolt_sim *sim, const peer_world *world, const peer_setting *setting)
{
  JPH::PhysicsSettings settings;
  settings.mNumVelocitySteps = JPH::uint(setting->iterations);
  settings.mPenetrationSlop = float(world->layer);
  settings.mSpeculativeContactDistance = touch_ahead;
  settings.mManifoldTolerance = flat_within;
  settings.mTimeBeforeSleep = float(PEER_SLEEP_S);
  settings.mAllowSleeping = setting->may_sleep;
  sim->system.SetPhysicsSettings(settings);
  sim->system.SetGravity(JPH::Vec3(0.0F, 0.0F, float(-world->gravity)));
}

void *jolt_create(const peer_world *world, const peer_setting *setting)
{
  types_register();
  auto *sim = new jolt_sim(world->boxes_pass);
  sim->step_s = float(setting->step_s);
  sim->system.Init(JPH::uint(world->count) + 2, 0, pairs_most, pairs_most, sim->layers.broad,
                   sim->filter, sim->layers.pairs);
  settings_set(sim, world, setting);
  if (world->has_floor) {
    fixed_add(sim, world, new JPH::BoxShape(JPH::Vec3(floor_half, floor_half, 1.0F), edge_round),
              JPH::Vec3(0.0F, 0.0F, -1.0F));
  }
  if (world->ground.cells > 0 && !ground_add(sim, world)) {
    delete sim;
    return nullptr;
  }
  boxes_add(sim, world);
  for (size_t i = 0; i < world->joint_count; ++i) {
    joint_make(sim, &world->joints[i]);
  }
  sim->system.OptimizeBroadPhase();
  return sim;
}

void jolt_destroy(void *data)
{
  delete static_cast<jolt_sim *>(data);
}

void jolt_step(void *data, const peer_push *pushes, size_t count)
{
  auto *sim = static_cast<jolt_sim *>(data);
  JPH::BodyInterface &bodies = sim->system.GetBodyInterfaceNoLock();
  for (size_t i = 0; i < count; ++i) {
    bodies.AddForce(sim->bodies[pushes[i].box], vector_of(pushes[i].force),
                    JPH::RVec3(vector_of(pushes[i].point)));
  }
  sim->system.Update(sim->step_s, 1, &sim->memory, &sim->jobs);
}

void vector_to(JPH::Vec3 v, double out[3])
{
  for (JPH::uint i = 0; i < 3; ++i) {
    out[i] = double(v[i]);
  }
}

void jolt_read(const void *data, size_t box, peer_motion *out)
{
  const auto *sim = static_cast<const jolt_sim *>(data);
  const JPH::BodyInterface &bodies = sim->system.GetBodyInterfaceNoLock();
  JPH::BodyID body = sim->bodies[box];
  JPH::Quat q = bodies.GetRotation(body);
  vector_to(JPH::Vec3(bodies.GetCenterOfMassPosition(body)), out->position);
  vector_to(bodies.GetLinearVelocity(body), out->linear);
  vector_to(bodies.GetAngularVelocity(body), out->angular);
  out->quat_wxyz[0] = double(q.GetW());
  out->quat_wxyz[1] = double(q.GetX());
  out->quat_wxyz[2] = double(q.GetY());
  out->quat_wxyz[3] = double(q.GetZ());
}

double jolt_mass(const void *data, size_t box)
{
  const auto *sim = static_cast<const jolt_sim *>(data);
  JPH::BodyLockRead lock(sim->system.GetBodyLockInterface(), sim->bodies[box]);
  return 1.0 / double(lock.GetBody().GetMotionProperties()->GetInverseMass());
}

bool jolt_sleeps(const void *data, size_t box)
{
  const auto *sim = static_cast<const jolt_sim *>(data);
  return !sim->system.GetBodyInterfaceNoLock().IsActive(sim->bodies[box]);
}

size_t jolt_boxes(const void *data)
{
  return static_cast<const jolt_sim *>(data)->system.GetBodyStats().mNumBodiesDynamic;
}

} // namespace

extern "C" const peer_engine peer_jolt = {"jolt",      10,           5000,      true,
                                          jolt_create, jolt_destroy, jolt_step, jolt_read,
                                          jolt_mass,   jolt_sleeps,  jolt_boxes};
