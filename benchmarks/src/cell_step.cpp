/// Processor time of one complete step of the simulated cell at a 1 ms FRI period, and of mj_step
/// alone on the same model and states: `cell_step BLOCKS STEPS` prints "CELL_NS MUJOCO_NS CONTACTS"
/// per block. A complete step is controller, KRL program, servos, plant with an object in the
/// fingers, torque signals and the measurement's 916 bytes, answered by a mirrored command.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

#include "coglab_sim/cell.hpp"

namespace fri = lwr_fri_bridge::fri;
using namespace coglab_sim;

namespace {

/// Processor time of this thread, ns: other work on the machine does not count.
double processorTime() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e9 * static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec);
}

/// What a step started from and which forces acted in it, to be put back before mj_step.
struct Start {
  std::vector<mjtNum> position, velocity, warm, control, applied, wrench;

  void before(const mjModel* m, const mjData* d) {
    position.assign(d->qpos, d->qpos + m->nq);
    velocity.assign(d->qvel, d->qvel + m->nv);
    warm.assign(d->qacc_warmstart, d->qacc_warmstart + m->nv);
  }
  void after(const mjModel* m, const mjData* d) {
    control.assign(d->ctrl, d->ctrl + m->nu);
    applied.assign(d->qfrc_applied, d->qfrc_applied + m->nv);
    wrench.assign(d->xfrc_applied, d->xfrc_applied + 6 * m->nbody);
  }
  void restore(mjData* d) const {
    std::copy(position.begin(), position.end(), d->qpos);
    std::copy(velocity.begin(), velocity.end(), d->qvel);
    std::copy(warm.begin(), warm.end(), d->qacc_warmstart);
    std::copy(control.begin(), control.end(), d->ctrl);
    std::copy(applied.begin(), applied.end(), d->qfrc_applied);
    std::copy(wrench.begin(), wrench.end(), d->xfrc_applied);
  }
};

/// The cell with a mug in its fingers, and a client that answers.
class Client {
 public:
  Client() : cell_(config()) {
    cell_.step(nullptr, 0);
    MotorCommands closed = {{{1.0, 0.96}}};
    for (std::size_t i = 1; i < closed.size(); ++i) closed[i] = {1.0, 1.0, 240.0};
    cell_.setMotors(closed);
    for (int i = 0; i < 3000; ++i) step();
  }
  /// Mirrors the set-point, and steps.
  void step() {
    fri::MeasurementDatagram measurement;
    const MeasurementBytes& received = cell_.measurement();
    fri::decode(received.data(), received.size(), measurement);
    command_.header = fri::commandHeader(++counter_, measurement.header.counter);
    command_.flags = fri::kJointPosition;
    fri::setPointOf(measurement, command_.joint_position);
    fri::encode(command_, bytes_.data());
    cell_.step(bytes_.data(), bytes_.size());
  }
  Cell& cell() { return cell_; }

 private:
  static CellConfig config() {
    CellConfig config;
    config.urdf = URDF_FILE;
    config.krc.period = plant::kStep;
    config.object_start = "robot_hand";
    const Quaterniond turn(0.5, -0.5, -0.5, -0.5);
    config.object_pose = {Vector3d(0.04, 0.0, 0.0) - turn * config.object.center, turn};
    return config;
  }
  Cell cell_;
  std::uint16_t counter_ = 0;
  fri::CommandDatagram command_{};
  std::array<std::uint8_t, fri::kCommandSize> bytes_{};
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: %s BLOCKS STEPS\n", argv[0]);
    return 2;
  }
  const int blocks = std::atoi(argv[1]), steps = std::atoi(argv[2]);
  Client client;
  plant::Plant& plant = client.cell().plant();
  const mjModel* m = plant.model().get();
  mjData* replay = mj_makeData(m);
  for (int block = 0; block < blocks; ++block) {
    std::vector<Start> starts(static_cast<std::size_t>(steps));
    double cell_ns = 0.0, mujoco_ns = 0.0;
    int contacts = 1000, tick = 0;
    for (Start& start : starts) {
      const double sway = tick++ / 200 % 2 == 0 ? 4.0 : -4.0;  // N, of somebody at the hand
      client.cell().setPush({Vector3d(0.0, sway, 0.0), Vector3d::Zero()});
      start.before(m, plant.model().data());
      const double begin = processorTime();
      client.step();
      cell_ns += processorTime() - begin;
      start.after(m, plant.model().data());
      contacts = std::min(contacts, plant.contacts());
    }
    for (const Start& start : starts) {
      start.restore(replay);
      const double begin = processorTime();
      mj_step(m, replay);
      mujoco_ns += processorTime() - begin;
    }
    std::printf("%.1f %.1f %d\n", cell_ns / steps, mujoco_ns / steps, contacts);
  }
  mj_deleteData(replay);
  return 0;
}
