/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Bullet: sequential impulses, one thread. The floor is a box, as is usual: a plane gets one
 * contact of a box in a step. */

#include <btBulletDynamicsCommon.h>

#include <cmath>
#include <memory>
#include <vector>

#include "bench/peer.h"

namespace {

constexpr double floor_half = 10.0; /* m */
constexpr int group_fixed = 1;
constexpr int group_boxes = 2;

struct bullet_sim {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  std::unique_ptr<btTriangleIndexVertexArray> mesh;
  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  std::vector<std::unique_ptr<btRigidBody>> fixed;
  std::vector<std::unique_ptr<btRigidBody>> bodies;
  std::vector<std::unique_ptr<btTypedConstraint>> joints;
  double step_s = 0.0;

  ~bullet_sim();
};

bullet_sim::~bullet_sim()
{
  for (auto &joint : joints) {
    world.removeConstraint(joint.get());
  }
  for (auto &body : bodies) {
    world.removeRigidBody(body.get());
  }
  for (auto &body : fixed) {
    world.removeRigidBody(body.get());
  }
}

btVector3 vector_of(const double v[3])
{
  return btVector3(btScalar(v[0]), btScalar(v[1]), btScalar(v[2]));
}

btRigidBody *body_make(const peer_world *world, double mass, btCollisionShape *shape,
                       const btVector3 &at)
{
  btVector3 inertia(0, 0, 0);
  if (mass > 0.0) {
    shape->calculateLocalInertia(btScalar(mass), inertia);
  }
  btRigidBody::btRigidBodyConstructionInfo info(btScalar(mass), nullptr, shape, inertia);
  info.m_startWorldTransform = btTransform(btQuaternion::getIdentity(), at);
  info.m_friction = btScalar(std::sqrt(world->mu)); /* of a pair: the product */
  return new btRigidBody(info);
}

void fixed_add(bullet_sim *sim, const peer_world *world, btCollisionShape *shape,
               const btVector3 &at)
{
  sim->shapes.emplace_back(shape);
  sim->fixed.emplace_back(body_make(world, 0.0, shape, at));
  sim->world.addRigidBody(sim->fixed.back().get(), group_fixed, group_boxes);
}

void ground_add(bullet_sim *sim, const peer_world *world)
{
  const peer_ground *g = &world->ground;
  btIndexedMesh part;
  part.m_numTriangles = int(g->triangle_count);
  part.m_triangleIndexBase = reinterpret_cast<const unsigned char *>(g->indices);
  part.m_triangleIndexStride = 3 * sizeof *g->indices;
  part.m_numVertices = int(g->vertex_count);
  part.m_vertexBase = reinterpret_cast<const unsigned char *>(g->vertices);
  part.m_vertexStride = 3 * sizeof *g->vertices;
  part.m_indexType = PHY_INTEGER;
  part.m_vertexType = PHY_DOUBLE;
  sim->mesh = std::make_unique<btTriangleIndexVertexArray>();
  sim->mesh->addIndexedMesh(part, PHY_INTEGER);
  auto *shape = new btBvhTriangleMeshShape(sim->mesh.get(), true);
  shape->setMargin(0);
  fixed_add(sim, world, shape, btVector3(0, 0, 0));
}

void boxes_add(bullet_sim *sim, const peer_world *world, bool may_sleep)
{
  int meets = world->boxes_pass ? group_fixed : group_fixed | group_boxes;
  for (size_t i = 0; i < world->count; ++i) {
    const peer_box *box = &world->boxes[i];
    auto *shape = new btBoxShape(vector_of(box->edges) / 2);
    sim->shapes.emplace_back(shape);
    sim->bodies.emplace_back(body_make(world, box->mass, shape, vector_of(box->at)));
    btRigidBody *body = sim->bodies.back().get();
    if (!may_sleep) {
      body->setActivationState(DISABLE_DEACTIVATION);
    }
    sim->world.addRigidBody(body, group_boxes, meets);
  }
}

btTypedConstraint *joint_make(const bullet_sim *sim, const peer_world *world,
                              const peer_joint *joint)
{
  btRigidBody &child = *sim->bodies[size_t(joint->child)];
  btVector3 anchor = vector_of(joint->anchor);
  btVector3 axis = vector_of(joint->axis);
  btVector3 in_child = anchor - vector_of(world->boxes[joint->child].at);
  if (joint->parent < 0) {
    if (joint->kind == PEER_BALL) {
      return new btPoint2PointConstraint(child, in_child);
    }
    return new btHingeConstraint(child, in_child, axis);
  }
  btRigidBody &parent = *sim->bodies[size_t(joint->parent)];
  btVector3 in_parent = anchor - vector_of(world->boxes[joint->parent].at);
  if (joint->kind == PEER_BALL) {
    return new btPoint2PointConstraint(child, parent, in_child, in_parent);
  }
  return new btHingeConstraint(child, parent, in_child, in_parent, axis, axis);
}

void *bullet_create(const peer_world *world, const peer_setting *setting)
{
  auto *sim = new bullet_sim;
  sim->step_s = setting->step_s;
  sim->world.setGravity(btVector3(0, 0, btScalar(-world->gravity)));
  btContactSolverInfo &info = sim->world.getSolverInfo();
  info.m_numIterations = setting->iterations;
  info.m_linearSlop = btScalar(world->layer);
  gDeactivationTime = btScalar(PEER_SLEEP_S);
  if (world->has_floor) {
    auto half = btScalar(floor_half);
    fixed_add(sim, world, new btBoxShape(btVector3(half, half, 1)), btVector3(0, 0, -1));
  }
  if (world->ground.cells > 0) {
    ground_add(sim, world);
  }
  boxes_add(sim, world, setting->may_sleep);
  for (size_t i = 0; i < world->joint_count; ++i) {
    sim->joints.emplace_back(joint_make(sim, world, &world->joints[i]));
    sim->world.addConstraint(sim->joints.back().get(), world->boxes_pass);
  }
  return sim;
}

void bullet_destroy(void *data)
{
  delete static_cast<bullet_sim *>(data);
}

void bullet_step(void *data, const peer_push *pushes, size_t count)
{
  auto *sim = static_cast<bullet_sim *>(data);
  for (size_t i = 0; i < count; ++i) {
    btRigidBody *body = sim->bodies[pushes[i].box].get();
    body->activate();
    body->applyForce(vector_of(pushes[i].force),
                     vector_of(pushes[i].point) - body->getCenterOfMassPosition());
  }
  sim->world.stepSimulation(btScalar(sim->step_s), 0);
}

void vector_to(const btVector3 &v, double out[3])
{
  for (int i = 0; i < 3; ++i) {
    out[i] = double(v[i]);
  }
}

void bullet_read(const void *data, size_t box, peer_motion *out)
{
  const btRigidBody *body = static_cast<const bullet_sim *>(data)->bodies[box].get();
  btQuaternion q = body->getOrientation();
  vector_to(body->getCenterOfMassPosition(), out->position);
  vector_to(body->getLinearVelocity(), out->linear);
  vector_to(body->getAngularVelocity(), out->angular);
  out->quat_wxyz[0] = double(q.w());
  out->quat_wxyz[1] = double(q.x());
  out->quat_wxyz[2] = double(q.y());
  out->quat_wxyz[3] = double(q.z());
}

double bullet_mass(const void *data, size_t box)
{
  return 1.0 / double(static_cast<const bullet_sim *>(data)->bodies[box]->getInvMass());
}

bool bullet_sleeps(const void *data, size_t box)
{
  return !static_cast<const bullet_sim *>(data)->bodies[box]->isActive();
}

size_t bullet_boxes(const void *data)
{
  const btCollisionObjectArray &objects =
      static_cast<const bullet_sim *>(data)->world.getCollisionObjectArray();
  size_t sum = 0;
  for (int i = 0; i < objects.size(); ++i) {
    sum += !objects[i]->isStaticObject();
  }
  return sum;
}

} // namespace

extern "C" const peer_engine peer_bullet = {
    "bullet",    10,          5000,        true,          bullet_create, bullet_destroy,
    bullet_step, bullet_read, bullet_mass, bullet_sleeps, bullet_boxes};
