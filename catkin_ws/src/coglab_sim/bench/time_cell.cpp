/// Prints the processor time of one complete step of the cell at a 1 ms FRI period, and of the
/// rigid-body terms alone, ns.
///
/// usage: coglab_sim_bench_cell URDF BLOCKS STEPS; one line per block: "cell_ns terms_ns". A
/// complete step is controller, KRL program, object in the person's grip, servo, arm, torque
/// signals and the measurement's 916 bytes, answered by a mirrored command.
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "coglab_sim/cell.hpp"

namespace fri = lwr_fri_bridge::fri;
using namespace coglab_sim;

namespace {

/// Mirrors the set-point with a small motion on top.
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

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: %s URDF BLOCKS STEPS\n", argv[0]);
    return 2;
  }
  CellConfig config;
  config.urdf = argv[1];
  config.krc.period = 0.001;
  const int blocks = std::atoi(argv[2]), steps = std::atoi(argv[3]);
  Cell cell(config);
  plant::PersonInput human;
  human.hand.position = Vector3d(0.7, 0.0, 0.6);
  human.grip = 1.0;
  ArmModel model(config.urdf);
  ArmTerms terms;
  std::uint16_t counter = 0;
  fri::CommandDatagram command{};
  std::array<std::uint8_t, fri::kCommandSize> bytes{};
  cell.step(nullptr, 0);
  double sum = 0.0;
  for (int block = 0; block < blocks; ++block) {
    double begin = processorTime();
    for (int i = 0; i < steps; ++i) {
      cell.setHuman(human);
      answer(cell.measurement(), counter, command);
      fri::encode(command, bytes.data());
      cell.step(bytes.data(), bytes.size());
    }
    const double cell_ns = (processorTime() - begin) / steps;
    begin = processorTime();
    for (int i = 0; i < steps; ++i) {
      model.evaluate(cell.plant().position(), cell.plant().velocity(), terms);
      sum += terms.gravity[1];
    }
    std::printf("%.1f %.1f\n", cell_ns, (processorTime() - begin) / steps);
  }
  return sum == 0.0 ? 1 : 0;
}
