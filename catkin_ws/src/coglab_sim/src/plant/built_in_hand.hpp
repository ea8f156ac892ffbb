/// @file
/// Text of config/hand_model.yaml.
#pragma once

namespace coglab_sim::plant {
extern const char* const kBuiltInHand;
}  // namespace coglab_sim::plant
