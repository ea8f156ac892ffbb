/// Prints the processor time of one step of the plant, of mj_step on the same model and states, and
/// the number of contacts, over a grasp that the arm shakes.
///
/// usage: coglab_sim_bench_plant URDF BLOCKS STEPS; one line per block: "plant_ns mujoco_ns
/// contacts", contacts as the smallest number in the block. The states, controls and forces of each
/// step are kept and put back before mj_step, so that both compute the same.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

#include "coglab_sim/plant/plant.hpp"

using namespace coglab_sim;
using namespace coglab_sim::plant;

namespace {

/// Processor time of this thread, ns, so that other work on the machine does not count.
double processorTime() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e9 * static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec);
}

/// Everything that mj_step starts from.
struct Start {
  std::vector<mjtNum> qpos, qvel, ctrl, applied, wrench, warm;
};

Start startOf(const mjModel* m, const mjData* d) {
  return {{d->qpos, d->qpos + m->nq},
          {d->qvel, d->qvel + m->nv},
          {d->ctrl, d->ctrl + m->nu},
          {d->qfrc_applied, d->qfrc_applied + m->nv},
          {d->xfrc_applied, d->xfrc_applied + 6 * m->nbody},
          {d->qacc_warmstart, d->qacc_warmstart + m->nv}};
}

void restore(const Start& start, mjData* d) {
  std::copy(start.qpos.begin(), start.qpos.end(), d->qpos);
  std::copy(start.qvel.begin(), start.qvel.end(), d->qvel);
  std::copy(start.ctrl.begin(), start.ctrl.end(), d->ctrl);
  std::copy(start.applied.begin(), start.applied.end(), d->qfrc_applied);
  std::copy(start.wrench.begin(), start.wrench.end(), d->xfrc_applied);
  std::copy(start.warm.begin(), start.warm.end(), d->qacc_warmstart);
}

/// A servo at 60 rad/s whose terms were computed elsewhere: its cost is not the plant's.
Vector7 servo(Plant& plant, const Vector7& target) {
  const mjModel* m = plant.model().get();
  const mjData* d = plant.model().data();
  Vector7 torque;
  for (int i = 0; i < 7; ++i) {
    const int dof = plant.model().arm_velocity[static_cast<std::size_t>(i)];
    const double inertia = d->qM[m->dof_Madr[dof]];
    torque[i] = d->qfrc_bias[dof] + inertia * 60.0 * (60.0 * (target[i] - plant.position()[i]) -
                                                      2.0 * plant.velocity()[i]);
  }
  return torque;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: %s URDF BLOCKS STEPS\n", argv[0]);
    return 2;
  }
  PlantConfig config;
  config.urdf = argv[1];
  config.home << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782;
  const int blocks = std::atoi(argv[2]), steps = std::atoi(argv[3]);
  Plant plant(config);
  PersonInput person;
  person.hand.position = Vector3d(1.1, 0.2, 0.3);
  plant.setPerson(person);
  const double preshape[] = {0.96, 0.02, 0.12, 0.2, 0.2};
  for (int i = 0; i < kMotors; ++i) plant.motors().set(i, preshape[i]);
  const Quaterniond turn(0.5, -0.5, -0.5, -0.5);
  plant.place(Place::RobotHand, {Vector3d(0.04, 0.0, 0.0) - turn * config.object.center, turn});
  for (int i = 1; i < kMotors; ++i) plant.motors().command(i, {1.0, 1.0, 240.0});
  for (int i = 0; i < 1500; ++i) plant.step(servo(plant, config.home));

  const mjModel* m = plant.model().get();
  mjData* replay = mj_makeData(m);
  for (int block = 0; block < blocks; ++block) {
    std::vector<Vector7> torques;
    std::vector<Start> starts;
    double plant_ns = 0.0;
    int contacts = 1000;
    for (int i = 0; i < steps; ++i) {
      Vector7 target = config.home;
      target[0] += 0.03 * std::sin(6.28 * 2.0 * plant.time());
      const Vector7 torque = servo(plant, target);
      const std::vector<mjtNum> qpos(plant.model().data()->qpos,
                                     plant.model().data()->qpos + m->nq),
          qvel(plant.model().data()->qvel, plant.model().data()->qvel + m->nv),
          warm(plant.model().data()->qacc_warmstart,
               plant.model().data()->qacc_warmstart + m->nv);
      const double begin = processorTime();
      plant.step(torque);
      plant_ns += processorTime() - begin;
      contacts = std::min(contacts, plant.contacts());
      Start start = startOf(m, plant.model().data());  // the forces are those of this step
      start.qpos = qpos;
      start.qvel = qvel;
      start.warm = warm;
      starts.push_back(std::move(start));
    }
    double mujoco_ns = 0.0;
    for (const Start& start : starts) {
      restore(start, replay);
      const double begin = processorTime();
      mj_step(m, replay);
      mujoco_ns += processorTime() - begin;
    }
    std::printf("%.1f %.1f %d\n", plant_ns / steps, mujoco_ns / steps, contacts);
  }
  mj_deleteData(replay);
  return 0;
}
