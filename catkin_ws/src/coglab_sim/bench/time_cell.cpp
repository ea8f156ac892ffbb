/// Prints the processor time of one complete step of the cell at a 1 ms FRI period, of mj_step on
/// the same model and states, and of the controller's rigid-body terms alone, ns, and the smallest
/// number of contacts.
///
/// usage: coglab_sim_bench_cell URDF BLOCKS STEPS; one line per block: "cell_ns mujoco_ns terms_ns
/// contacts". A complete step is controller, KRL program, servos, plant with an object in the
/// fingers of the moving arm, torque signals and the measurement's 916 bytes, answered by a
/// mirrored command. What each step started from is kept and put back before mj_step, so that both
/// compute the same.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

#include "coglab_sim/cell.hpp"

namespace fri = lwr_fri_bridge::fri;
using namespace coglab_sim;

namespace {

/// Mirrors the set-point.
void answer(const MeasurementBytes& bytes, std::uint16_t& counter, fri::CommandDatagram& command) {
  fri::MeasurementDatagram measurement;
  fri::decode(bytes.data(), bytes.size(), measurement);
  command.header = fri::commandHeader(++counter, measurement.header.counter);
  command.flags = fri::kJointPosition;
  fri::setPointOf(measurement, command.joint_position);
}

/// Processor time of this thread, ns, so that other work on the machine does not count.
double processorTime() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e9 * static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec);
}

/// What mj_step starts from.
struct Start {
  std::vector<mjtNum> position, velocity, warm, control, applied, wrench;

  /// State before the step.
  void before(const mjModel* m, const mjData* d) {
    position.assign(d->qpos, d->qpos + m->nq);
    velocity.assign(d->qvel, d->qvel + m->nv);
    warm.assign(d->qacc_warmstart, d->qacc_warmstart + m->nv);
  }
  /// Forces that acted in it.
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
class Bench {
 public:
  explicit Bench(const std::string& urdf) : cell_(configOf(urdf)) {
    cell_.step(nullptr, 0);
    MotorCommands closed = {{{1.0, 0.96}}};
    for (std::size_t i = 1; i < closed.size(); ++i) closed[i] = {1.0, 1.0, 240.0};
    cell_.setMotors(closed);
    for (int i = 0; i < 3000; ++i) step();
  }
  void step() {
    answer(cell_.measurement(), counter_, command_);
    fri::encode(command_, bytes_.data());
    cell_.step(bytes_.data(), bytes_.size());
  }
  /// Somebody sways the hand.
  void sway(int tick) {
    cell_.setPush({Vector3d(0.0, tick / 200 % 2 == 0 ? 4.0 : -4.0, 0.0), Vector3d::Zero()});
  }
  Cell& cell() { return cell_; }

 private:
  static CellConfig configOf(const std::string& urdf) {
    CellConfig config;
    config.urdf = urdf;
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

void runBlock(Bench& bench, ArmModel& arm, mjData* replay, int steps) {
  plant::Plant& plant = bench.cell().plant();
  const mjModel* m = plant.model().get();
  std::vector<Start> starts(static_cast<std::size_t>(steps));
  double cell_ns = 0.0, mujoco_ns = 0.0;
  int contacts = 1000, tick = 0;
  for (Start& start : starts) {
    bench.sway(tick++);
    start.before(m, plant.model().data());
    const double begin = processorTime();
    bench.step();
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
  ArmTerms terms;
  const double begin = processorTime();
  for (int i = 0; i < steps; ++i) arm.evaluate(plant.position(), plant.velocity(), terms);
  std::printf("%.1f %.1f %.1f %d\n", cell_ns / steps, mujoco_ns / steps,
              (processorTime() - begin) / steps, contacts);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: %s URDF BLOCKS STEPS\n", argv[0]);
    return 2;
  }
  const int blocks = std::atoi(argv[2]), steps = std::atoi(argv[3]);
  Bench bench(argv[1]);
  ArmModel arm(argv[1]);
  mjData* replay = mj_makeData(bench.cell().plant().model().get());
  for (int block = 0; block < blocks; ++block) runBlock(bench, arm, replay, steps);
  mj_deleteData(replay);
  return 0;
}
