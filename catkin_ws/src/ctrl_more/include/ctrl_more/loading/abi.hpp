#pragma once

#include <array>
#include <cstddef>
#include <string>

#include <Eigen/Core>

namespace ctrl_more {

/// What a plug-in library and the program that loads it must have in common. The compiler fills it
/// in on both sides; a library whose numbers differ would read and write in the wrong places, and
/// is refused.
struct Abi {
  int interface = 0;     ///< version of the headers: raised when classes or meanings change
  int compiler_abi = 0;  ///< `__GXX_ABI_VERSION`
  int eigen = 0;         ///< Eigen's version, 10000 world + 100 major + minor
  int eigen_align = 0;   ///< alignment that Eigen assumes [bytes]; depends on `-march`
  std::array<std::size_t, 16> sizes{};  ///< of the classes that both sides share [bytes]

  /// True if every number is the same.
  bool operator==(const Abi& other) const {
    return interface == other.interface && compiler_abi == other.compiler_abi &&
           eigen == other.eigen && eigen_align == other.eigen_align && sizes == other.sizes;
  }

  /// All numbers, for messages.
  std::string text() const {
    std::string all = "interface " + std::to_string(interface) + ", compiler ABI " +
                      std::to_string(compiler_abi) + ", Eigen " + std::to_string(eigen) +
                      " aligned to " + std::to_string(eigen_align) + ", sizes";
    for (const std::size_t size : sizes) {
      if (size != 0) all += " " + std::to_string(size);
    }
    return all;
  }

  /// The clause about a library with these numbers, to which the program is a stranger.
  /// @param package whose headers it was compiled with
  /// @param program the numbers of the program that loads it
  std::string otherThan(const std::string& package, const Abi& program) const {
    return "compiled for another " + package + " (" + text() + "; this program has " +
           program.text() + "): build it again with the headers and the compiler of this program";
  }
};

/// The numbers of the file that is being compiled. Static, so that a library keeps its own.
/// @tparam Shared the classes that libraries and the program share
/// @param interface version of the headers
template <typename... Shared>
static constexpr Abi abiOf(int interface) {
  return {interface,
          __GXX_ABI_VERSION,
          10000 * EIGEN_WORLD_VERSION + 100 * EIGEN_MAJOR_VERSION + EIGEN_MINOR_VERSION,
          EIGEN_MAX_ALIGN_BYTES,
          {sizeof(Shared)...}};
}

}  // namespace ctrl_more
