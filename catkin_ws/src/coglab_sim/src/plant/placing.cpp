/// What may stand where in the plant: an object that is placed, the surroundings, the person's
/// hand.
#include <algorithm>
#include <array>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "coglab_sim/plant/plant.hpp"
#include "overlap.hpp"

namespace coglab_sim::plant {
namespace {

constexpr double kInside = 0.003;  // m by which anything may stand in something at a start
// m by which the object may stand in a phalanx, which gives way: less than half of its thickness.
constexpr double kInFinger = 0.008;

// How the robot's hand takes an object at a start: the shape of the cylindrical grasp, bytes of the
// five motors (thumb opposed, all others nearly open), and the current at which they stop, half of
// what the tension limit adds. Ours.
constexpr std::array<double, kMotors> kPreshape = {245 / 255.0, 5 / 255.0, 30 / 255.0, 50 / 255.0,
                                                   50 / 255.0};
constexpr double kCloseCurrent = 240.0;                         // counts
constexpr int kOpening = 300, kClosing = 2500, kHanging = 300;  // steps
constexpr double kCarries = 1.5;  // friction over weight from which on it hangs in the fingers
constexpr double kStays = 0.02;   // m that it may move in the palm once it hangs in the fingers

}  // namespace

std::string Plant::nameOf(int geom) const {
  const mjModel* m = model_->get();
  const int body = m->geom_bodyid[geom];
  if (body == model_->object) return "object '" + config_.object.id + "'";
  if (body == model_->person) return "the person's hand";
  const char* name = body == 0 ? mj_id2name(m, mjOBJ_GEOM, geom) : mj_id2name(m, mjOBJ_BODY, body);
  return name != nullptr ? name : "something";
}

/// Whether two geoms must not stand in each other: they collide, or are object and forearm.
bool Plant::excludeEachOther(int one, int two) const {
  const mjModel* m = model_->get();
  const int first = m->geom_bodyid[one], second = m->geom_bodyid[two];
  const auto root = [&](int body) { return m->body_rootid[body] == m->body_rootid[model_->palm]; };
  if (m->body_weldid[first] == m->body_weldid[second]) return false;
  // The arm folded onto itself is found by its guard; neighbours overlap by the way they are drawn.
  if (root(first) && root(second)) return false;
  // The person's fingers close on the object, and do not collide; the forearm behind them is solid.
  if ((first == model_->object && second == model_->person) ||
      (second == model_->object && first == model_->person))
    return true;
  return (m->geom_contype[one] & m->geom_conaffinity[two]) != 0 ||
         (m->geom_contype[two] & m->geom_conaffinity[one]) != 0;
}

/// Throws if a body (-1: anything but the object) stands in something too deep.
void Plant::refuseOverlap(int body, const char* where) const {
  const mjModel* m = model_->get();
  const auto deepest = [&](bool in_finger) {
    return deepestOverlap(m, model_->data(), [&](int one, int two) {
      const int first = m->geom_bodyid[one], second = m->geom_bodyid[two];
      const auto either = [&](int which) { return first == which || second == which; };
      if (body < 0 ? either(model_->object) : !either(body)) return false;
      const bool finger = either(model_->object) &&
                          std::any_of(model_->phalanges.begin(), model_->phalanges.end(), either);
      return finger == in_finger && excludeEachOther(one, two);
    });
  };
  Overlap found = deepest(false);
  double most = kInside;
  if (found.depth <= most) {
    found = deepest(true);
    most = kInFinger;
  }
  if (found.depth <= most) return;
  const bool swap = m->geom_bodyid[found.two] == model_->object ||
                    (body >= 0 && m->geom_bodyid[found.two] == body);
  std::ostringstream text;
  text.precision(3);
  text << nameOf(swap ? found.two : found.one) << " would stand " << 1e3 * found.depth
       << " mm inside " << nameOf(swap ? found.one : found.two) << ' ' << where << ", at most "
       << 1e3 * most << " mm are accepted; place it elsewhere";
  throw std::invalid_argument(text.str());
}

Plant::State Plant::state() const {
  const mjModel* m = model_->get();
  const mjData* d = model_->data();
  return {{d->qpos, d->qpos + m->nq}, {d->qvel, d->qvel + m->nv}};
}

/// Computes everything for the positions as they are now; where a body would stand in something,
/// they become again what they were before, and it throws.
void Plant::acceptOr(const State& before, int body, const char* where) {
  mjData* d = model_->data();
  mj_step1(model_->get(), d);
  try {
    refuseOverlap(body, where);
  } catch (const std::invalid_argument&) {
    std::copy(before.position.begin(), before.position.end(), d->qpos);
    std::copy(before.velocity.begin(), before.velocity.end(), d->qvel);
    mj_step1(model_->get(), d);
    throw;
  }
}

void Plant::place(Place place, const Pose& pose) {
  if (place == Place::RobotHand) {
    placeInRobotHand(pose);
    return;
  }
  const State before = state();
  const bool in_hand = place == Place::PersonHand;
  const Pose hand = personHand(), object = in_hand ? hand * pose : pose;
  Twist twist;
  if (in_hand && person_present_) {
    const Twist with = twistOf(model_->person);
    twist = {with.at(object.position - hand.position), with.angular};
  }
  put(model_->object_position, model_->object_velocity, object, twist);
  acceptOr(before, model_->object, in_hand ? "in that hand" : "there");
  forget();
  place_ = place;
  in_hand_ = pose;
  placed_ = in_hand;
}

/// Nothing is known of an object that has just been placed.
void Plant::forget() {
  grip_.release();
  placed_ = grip_lost_ = false;
  on_board_ = on_floor_ = dropped_ = false;
  robot_share_ = person_share_ = squeeze_ = grasp_force_ = 0.0;
  object_force_.setZero();
  person_force_.setZero();
}

/// What the hand does at such a start is tried out beside: another plant, whose arm stands on its
/// brakes in the same posture, closes its fingers on the object, and only what it holds in the end
/// is taken over.
void Plant::placeInRobotHand(const Pose& in_palm) {
  PlantConfig config = config_;
  config.home = position_;
  Plant beside(config);
  std::copy(model_->get()->opt.gravity, model_->get()->opt.gravity + 3,
            beside.model_->get()->opt.gravity);
  beside.closeAround(in_palm);

  mjData* d = model_->data();
  const mjData* from = beside.model_->data();
  const State before = state();
  for (std::size_t i = 0; i < model_->phalanx_position.size(); ++i) {
    d->qpos[model_->phalanx_position[i]] = from->qpos[model_->phalanx_position[i]];
    d->qvel[model_->phalanx_velocity[i]] = 0.0;
  }
  const Pose palm = this->palm(), object = palm * (beside.palm().inverse() * beside.object());
  const Twist twist = palmTwist();
  put(model_->object_position, model_->object_velocity, object,
      {twist.at(object.position - palm.position), twist.angular});
  std::copy(from->qacc_warmstart, from->qacc_warmstart + model_->get()->nv, d->qacc_warmstart);
  acceptOr(before, model_->object, "in that hand");
  forget();
  place_ = Place::RobotHand;
  motors_ = beside.motors_;
  robot_share_ = beside.robot_share_;
  squeeze_ = beside.squeeze_;
  grasp_force_ = beside.grasp_force_;
  object_force_ = beside.object_force_;
}

/// Closes the hand of a plant that nobody else uses on the object, which is kept where it is to be
/// in the palm, and lets it hang. Throws if the fingers do not hold it there.
void Plant::closeAround(const Pose& in_palm) {
  const Vector7 off = Vector7::Zero();
  setBrakes(true);
  setArm(position_);
  locked_ = true;
  for (int motor = 0; motor < kMotors; ++motor)
    motors_.set(motor, kPreshape[static_cast<std::size_t>(motor)]);
  for (int i = 0; i < kOpening; ++i) step(off);
  place(Place::World, palm() * in_palm);
  place_ = Place::RobotHand;
  in_hand_ = in_palm;
  placed_ = true;
  for (int motor = 1; motor < kMotors; ++motor) motors_.command(motor, {1.0, 1.0, kCloseCurrent});
  const auto closing = [&] {
    for (int motor = 1; motor < kMotors; ++motor) {
      const MotorState& state = motors_.state(motor);
      if (!state.locked && state.position < 1.0 - 1e-5) return true;
    }
    return false;
  };
  const Object& thing = config_.object;
  for (int i = 0; i < kClosing && closing(); ++i) {
    step(off);
    placed_ = placed_ && thing.friction * grasp_force_ < kCarries * thing.mass * kGravity;
  }
  placed_ = false;
  for (int i = 0; i < kHanging; ++i) step(off);
  const double moved = ((palm().inverse() * object()).position - in_palm.position).norm();
  if (robotHolds() && moved <= kStays) return;
  std::ostringstream text;
  text.precision(3);
  text << "object '" << config_.object.id << "' cannot be placed in the robot's hand there: "
       << "closed around it, the fingers "
       << (robotHolds() ? "move it by " + std::to_string(static_cast<int>(1e3 * moved)) + " mm"
                        : std::string("do not hold it"))
       << "; place it within their reach, before the palm";
  throw std::invalid_argument(text.str());
}

}  // namespace coglab_sim::plant
