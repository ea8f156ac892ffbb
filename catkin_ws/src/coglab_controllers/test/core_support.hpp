/// @file
/// Common parts of the tests of the cores: the robot, random inputs, random demonstrations.
#pragma once

#include <fstream>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>

#include "coglab_controllers/dmp/learning.hpp"
#include "coglab_controllers/kinematics/chain.hpp"
#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers::test {

constexpr double kCycle = 0.005;  // s

inline std::string readFile(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

inline std::string robotUrdf() {
  return readFile(std::string(COGLAB_PACKAGE_DIR) + "/../lwr_description/urdf/lwr_ih2.urdf");
}

inline const Chain& robot() {
  static const Chain chain(robotUrdf(), "lwr_base_link", "ih2_palm");
  return chain;
}

/// Seeded random inputs.
class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double normal(double deviation) {
    return std::normal_distribution<double>(0.0, deviation)(engine_);
  }
  int integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }
  Vector3 point(double size) {
    return Vector3(uniform(-size, size), uniform(-size, size), uniform(-size, size));
  }
  JointVector joints(double size) {
    JointVector q;
    for (int i = 0; i < kMaxJoints; ++i) q[i] = uniform(-size, size);
    return q;
  }
  Quaternion rotation() {
    return Quaternion(normal(1), normal(1), normal(1), normal(1)).normalized();
  }
  /// Joint positions inside the arm's mechanical range, `margin` rad from its ends.
  JointVector posture(double margin) {
    JointVector q;
    for (int i = 0; i < kMaxJoints; ++i) {
      const double limit = (i % 2 == 0 ? 2.967 : 2.094) - margin;
      q[i] = uniform(-limit, limit);
    }
    return q;
  }

 private:
  std::mt19937 engine_;
};

/// Share of the way of a minimum-jerk motion at share u of its time.
inline double minimumJerk(double u) {
  u = u < 0.0 ? 0.0 : (u > 1.0 ? 1.0 : u);
  return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
}

/// Straight minimum-jerk demonstration.
inline Trajectory minimumJerkReach(const Vector3& from, const Vector3& to, double duration,
                                   int samples = 241) {
  Trajectory trajectory;
  trajectory.positions.resize(3, samples);
  for (int i = 0; i < samples; ++i) {
    const double u = static_cast<double>(i) / (samples - 1);
    trajectory.times.push_back(u * duration);
    trajectory.positions.col(i) = from + minimumJerk(u) * (to - from);
  }
  return trajectory;
}

/// A valid primitive with random shape, as no demonstration would give it.
inline Primitive randomPrimitive(Random& random) {
  Primitive p;
  p.id = "random";
  p.duration = random.uniform(0.4, 4.0);
  p.alpha = random.uniform(2.0, 8.0);
  p.stiffness = random.uniform(30.0, 600.0);
  p.damping = 2.0 * std::sqrt(p.stiffness);
  const int count = random.integer(2, kMaxBasis);
  placeBasis(count, p.alpha, p.centres, p.widths);
  p.weights.resize(3, count);
  for (int i = 0; i < count; ++i) p.weights.col(i) = random.point(0.5);
  p.start = random.point(0.5);
  p.goal = random.point(0.5);
  p.start_velocity = random.point(0.3);
  return p;
}

}  // namespace coglab_controllers::test
