#include <cmath>
#include <set>
#include <sstream>
#include <stdexcept>

#include "coglab_sim/plant/scene_description.hpp"
#include "coglab_sim/ranges.hpp"
#include "robot_description.hpp"

namespace coglab_sim::plant {
namespace {

// Collision groups: one bit each, and the groups it collides with. Fingers pass through each other
// and through the palm. The object has two shapes, because a cylinder touches a capsule in one
// point only: hands collide with a round shape (a capsule with the cylinder's side), planes with
// the solid itself.
struct Group {
  int own, meets;
};
constexpr int kArm = 1, kHand = 2, kObject = 4, kSolid = 8, kGround = 16, kPerson = 32;
constexpr Group kArmGroup{kArm, kArm | kHand | kObject | kGround | kPerson};
constexpr Group kHandGroup{kHand, kArm | kObject | kGround | kPerson};
constexpr Group kObjectGroup{kObject, kArm | kHand};
constexpr Group kSolidGroup{kSolid, kGround};
constexpr Group kGroundGroup{kGround, kArm | kHand | kSolid};
constexpr Group kPersonGroup{kPerson, kArm | kHand};

// With impratio 30 friction grasps hold. With fewer than about 5 iterations, impratio 1 or condim 3
// the hand loses round objects (measured). Euler treats joint damping implicitly.
constexpr const char* kHead = R"(
  <compiler angle="radian" autolimits="false" inertiafromgeom="false"/>
  <option timestep="0.001" gravity="0 0 -9.81" integrator="Euler" solver="Newton" cone="elliptic"
          impratio="30" iterations="20" tolerance="1e-8"/>
  <size njmax="1000" nconmax="200" nstack="4000000"/>
  <default><geom solref="0.005 1" solimp="0.9 0.95 0.002"/></default>
)";

class Writer {
 public:
  explicit Writer(const SceneDescription& scene)
      : scene_(scene), robot_(readRobotDescription(scene.urdf)) {
    out_.precision(17);
    for (const Joint* joint : robot_.chainTo(scene.hand.palm)) arm_.push_back(joint->name);
    if (arm_.size() != 7)
      throw std::runtime_error("robot description " + scene.urdf +
                               ": expected 7 joints to the hand's palm " + scene.hand.palm +
                               ", found " + std::to_string(arm_.size()));
    const double hand = robot_.links.at(scene.hand.palm).mass;
    if (scene.hand.phalangesMass() >= hand)  // the palm would have no mass left
      throw std::invalid_argument("hand table: the phalanges weigh " +
                                  std::to_string(scene.hand.phalangesMass()) +
                                  " kg, more than the whole hand " + scene.hand.palm + " in " +
                                  scene.urdf + ", " + std::to_string(hand) + " kg");
  }

  std::string write() {
    out_ << "<mujoco model=\"cell\">" << kHead << "<worldbody>\n";
    surroundings();
    link(robot_.root);
    object();
    person();
    out_ << "</worldbody>\n<contact>\n";
    neighbours();
    out_ << "</contact>\n";
    tendons();
    out_ << "</mujoco>\n";
    return out_.str();
  }

 private:
  std::ostream& vector(const char* name, const Vector3d& v) {
    return out_ << ' ' << name << "=\"" << v.x() << ' ' << v.y() << ' ' << v.z() << '"';
  }
  std::ostream& pose(const Pose& pose) {
    vector("pos", pose.position);
    const Quaterniond& q = pose.rotation;
    return out_ << " quat=\"" << q.w() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << '"';
  }
  std::ostream& group(const Group& group, int condim) {
    return out_ << " contype=\"" << group.own << "\" conaffinity=\"" << group.meets
                << "\" condim=\"" << condim << '"';
  }

  void surroundings() {
    const Surroundings& around = scene_.surroundings;
    out_ << "<geom name=\"floor\" type=\"plane\" size=\"0 0 1\"";
    vector("pos", {0.0, 0.0, around.floor_height});
    group(kGroundGroup, 4) << "/>\n";
    if (around.board_size.x() <= 0.0 || around.board_size.y() <= 0.0) return;
    constexpr double kHalf = 0.02;  // m, half thickness of the board
    out_ << "<geom name=\"board\" type=\"box\"";
    vector("size", {0.5 * around.board_size.x(), 0.5 * around.board_size.y(), kHalf});
    vector("pos", around.board_center - Vector3d(0.0, 0.0, kHalf));
    group(kGroundGroup, 4) << "/>\n";
  }

  void inertial(const Link& link, double mass, const Vector3d& center) {
    if (!link.has_inertia) return;
    const Matrix3d turn = link.inertia_frame.rotation.toRotationMatrix();
    const Matrix3d i = mass / link.mass * (turn * link.inertia * turn.transpose());
    out_ << "<inertial mass=\"" << mass << '"';
    vector("pos", center);
    tensor(i) << "/>\n";
  }
  std::ostream& tensor(const Matrix3d& i) {
    return out_ << " fullinertia=\"" << i(0, 0) << ' ' << i(1, 1) << ' ' << i(2, 2) << ' '
                << i(0, 1) << ' ' << i(0, 2) << ' ' << i(1, 2) << '"';
  }

  /// The palm gets the inertia of the description's hand minus the phalanges. Mass and centre of
  /// mass of the whole open hand stay the same.
  void palmInertial(const Link& palm) {
    MassMoment rest = robot_.withMovableLinks(palm.name);
    Vector3d pivot = Vector3d::Zero();
    for (const Phalanx& p : scene_.hand.phalanges) {
      pivot = p.first ? p.pivot : Vector3d(pivot + p.pivot);
      rest.mass -= p.mass;
      rest.moment -= p.mass * (pivot + 0.5 * p.length * p.along);
    }
    inertial(palm, rest.mass, rest.moment / rest.mass);
  }

  void solids(const Link& link, const Group& who, int condim) {
    for (const Solid& solid : link.collisions) {
      out_ << "<geom type=\"" << solid.kind << '"';
      vector("size", solid.size);
      pose(solid.pose);
      friction(who.own == kHand);
      group(who, condim) << "/>\n";
    }
  }
  void friction(bool hand) {
    if (!hand) return;
    out_ << " friction=\"" << scene_.hand.sliding << ' ' << scene_.hand.torsional << ' '
         << scene_.hand.rolling << '"';
  }

  /// Writes a link with all links behind it; the palm gets the fingers of the table.
  void link(const std::string& name, const Joint* joint = nullptr) {
    const Link& link = robot_.links.at(name);
    const bool palm = name == scene_.hand.palm;
    if (name == "world") {  // MuJoCo's name of the fixed body
      for (const Joint* next : robot_.below(name)) this->link(next->child, next);
      return;
    }
    out_ << "<body name=\"" << name << '"';
    if (joint != nullptr) pose(joint->origin);
    out_ << ">\n";
    if (palm) {
      palmInertial(link);
    } else {
      inertial(link, link.mass, link.inertia_frame.position);
    }
    if (joint != nullptr && joint->moves()) this->joint(*joint);
    solids(link, palm ? kHandGroup : kArmGroup, palm ? 4 : 3);
    if (palm) fingers();
    for (const Joint* next : robot_.below(name)) {
      if (palm && next->moves()) continue;  // the description's fingers
      this->link(next->child, next);
    }
    out_ << "</body>\n";
  }

  void joint(const Joint& joint) {
    out_ << "<joint name=\"" << joint.name << "\" type=\""
         << (joint.type == "prismatic" ? "slide" : "hinge") << '"';
    vector("axis", joint.axis);
    out_ << " damping=\"" << joint.damping << '"';
    for (std::size_t i = 0; i < arm_.size(); ++i) {
      if (arm_[i] == joint.name)
        out_ << " armature=\"" << scene_.rotor_inertia[static_cast<Eigen::Index>(i)] << '"';
    }
    out_ << " limited=\"" << (joint.limited() ? "true" : "false") << '"';
    if (joint.limited()) out_ << " range=\"" << joint.lower << ' ' << joint.upper << '"';
    out_ << "/>\n";
  }

  void fingers() {
    int open = 0;
    for (const Phalanx& phalanx : scene_.hand.phalanges) {
      if (phalanx.first) {
        for (; open > 0; --open) out_ << "</body>\n";
      }
      this->phalanx(phalanx);
      ++open;
    }
    for (; open > 0; --open) out_ << "</body>\n";
  }

  void phalanx(const Phalanx& p) {
    out_ << "<body name=\"" << p.name << '"';
    vector("pos", p.pivot) << ">\n<inertial mass=\"" << p.mass << '"';
    vector("pos", 0.5 * p.length * p.along);
    // Inertia of a solid cylinder with the capsule's length and radius.
    const double across = p.mass * (3.0 * p.radius * p.radius + p.length * p.length) / 12.0;
    const double about = 0.5 * p.mass * p.radius * p.radius;
    const Matrix3d i =
        across * Matrix3d::Identity() + (about - across) * p.along * p.along.transpose();
    tensor(i) << "/>\n";
    out_ << "<joint name=\"" << p.name << "\" type=\"hinge\"";
    vector("axis", p.axis);
    out_ << " limited=\"true\" range=\"" << p.lower << ' ' << p.upper << "\" stiffness=\""
         << p.spring << "\" springref=\"" << p.lower << "\" ref=\"0\" damping=\""
         << scene_.hand.joint_damping << "\" armature=\"" << scene_.hand.joint_armature << "\"/>\n";
    const Vector3d end = p.length * p.along;
    out_ << "<geom type=\"capsule\" fromto=\"0 0 0 " << end.x() << ' ' << end.y() << ' ' << end.z()
         << "\" size=\"" << p.radius << '"';
    friction(true);
    group(kHandGroup, 4) << "/>\n";
  }

  void object() {
    const Object& object = scene_.object;
    const Vector3d inertia = inertiaOf(object);
    out_ << "<body name=\"" << kObjectBody << "\" pos=\"0 0 5\">\n<freejoint name=\"object\"/>\n"
         << "<inertial mass=\"" << object.mass << '"';
    vector("pos", object.center);
    vector("diaginertia", inertia) << "/>\n";
    const Vector3d half = 0.5 * object.size;
    const bool cylinder = object.shape == "cylinder", sphere = object.shape == "sphere";
    const Vector3d size = cylinder ? Vector3d(half.x(), half.z(), 0.0)
                          : sphere ? Vector3d(half.x(), 0.0, 0.0)
                                   : half;
    for (const Group& who : {kObjectGroup, kSolidGroup}) {
      const bool round = cylinder && who.own == kObject;
      out_ << "<geom type=\"" << (round ? "capsule" : object.shape) << '"';
      vector("size", size);
      vector("pos", object.center);
      // Priority: contacts always use the friction of the object.
      out_ << " priority=\"1\" friction=\"" << object.friction << ' ' << scene_.hand.torsional
           << ' ' << scene_.hand.rolling << '"';
      if (round) out_ << " group=\"3\"";  // not drawn: MuJoCo shows groups 0 to 2
      group(who, 4) << "/>\n";
    }
    out_ << "</body>\n";
  }

  /// Fist and forearm of the person behind the frame human_hand, x toward the person. The inertia
  /// is the forearm's about the hand.
  void person() {
    out_ << "<body name=\"" << kPersonBody << "\" pos=\"5 0 5\">\n<freejoint name=\"person\"/>\n"
         << "<inertial pos=\"0 0 0\" mass=\"" << kPersonMass
         << "\" diaginertia=\"0.01 0.01 0.01\"/>\n"
         << "<geom type=\"capsule\" fromto=\"0.07 0 0 0.25 0 0\" size=\"0.03\"";
    group(kPersonGroup, 3) << "/>\n</body>\n";
  }

  /// Excludes contacts between links at most two joints apart, because their solids overlap in the
  /// description.
  void neighbours() {
    std::vector<std::string> bodies;
    for (const Joint* joint : robot_.chainTo(scene_.hand.palm)) {
      if (bodies.empty()) bodies.push_back(joint->parent);
      bodies.push_back(joint->child);
    }
    bodies.push_back(scene_.hand.palm);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      for (std::size_t j = i + 1; j < bodies.size() && j <= i + 3; ++j) {
        if (j == i + 3 && j + 1 != bodies.size()) continue;  // the palm is fixed to the last link
        out_ << "<exclude body1=\"" << bodies[i] << "\" body2=\"" << bodies[j] << "\"/>\n";
      }
    }
    // Fingers do not collide with the wrist, whose solids reach into the hand.
    for (const Phalanx& phalanx : scene_.hand.phalanges) {
      for (std::size_t i = bodies.size() - 3; i < bodies.size() - 1; ++i)
        out_ << "<exclude body1=\"" << bodies[i] << "\" body2=\"" << phalanx.name << "\"/>\n";
    }
  }

  void tendons() {
    const HandTable& hand = scene_.hand;
    out_ << "<tendon>\n";
    for (int motor = 0; motor < kMotors; ++motor) {
      out_ << "<fixed name=\"" << hand.motors[static_cast<std::size_t>(motor)].name << "\">\n";
      for (const Phalanx& p : hand.phalanges) {
        if (p.motor == motor)
          out_ << "<joint joint=\"" << p.name << "\" coef=\"" << p.arm << "\"/>\n";
      }
      out_ << "</fixed>\n";
    }
    out_ << "</tendon>\n<actuator>\n";
    for (const MotorRow& motor : hand.motors) {
      out_ << "<general name=\"" << motor.name << "\" tendon=\"" << motor.name
           << "\" gaintype=\"fixed\" biastype=\"affine\" gainprm=\"" << hand.tendon_stiffness
           << "\" biasprm=\"0 " << -hand.tendon_stiffness << " 0\" forcelimited=\"true\""
           << " forcerange=\"" << (motor.both_ways ? -motor.limit : 0.0) << ' ' << motor.limit
           << "\"/>\n";
    }
    out_ << "</actuator>\n";
  }

  const SceneDescription& scene_;
  RobotDescription robot_;
  std::vector<std::string> arm_;
  std::ostringstream out_;
};

}  // namespace

void checkObject(const Object& object) {
  const auto refuse = [&](const std::string& what) {
    throw std::invalid_argument("object '" + object.id + "': " + what);
  };
  if (object.shape != "box" && object.shape != "cylinder" && object.shape != "sphere")
    refuse("unknown shape '" + object.shape + "', expected box, cylinder or sphere");
  try {
#define OBJECT(type, field, value, name, low, high, ...) \
  requireFieldWithin({low, high}, name, object.field);
#include "coglab_sim/parameter_table.inc"
  } catch (const std::invalid_argument& error) {
    refuse(error.what());
  }
  if (object.center.norm() > 2.0) refuse("its centre is more than 2 m from its frame");
}

Vector3d inertiaOf(const Object& object) {
  const Vector3d s = object.size;
  if (object.shape == "sphere") return Vector3d::Constant(0.1 * object.mass * s.x() * s.x());
  if (object.shape == "cylinder") {
    const double r = 0.5 * s.x(), across = (3.0 * r * r + s.z() * s.z()) / 12.0;
    return object.mass * Vector3d(across, across, 0.5 * r * r);
  }
  return object.mass / 12.0 *
         Vector3d(s.y() * s.y() + s.z() * s.z(), s.x() * s.x() + s.z() * s.z(),
                  s.x() * s.x() + s.y() * s.y());
}

std::string writeModel(const SceneDescription& scene) {
  checkObject(scene.object);
  return Writer(scene).write();
}

std::array<std::string, 7> armJoints(const std::string& urdf, const std::string& palm_link) {
  const auto chain = readRobotDescription(urdf).chainTo(palm_link);
  std::array<std::string, 7> names;
  if (chain.size() != names.size())
    throw std::runtime_error("robot description " + urdf + ": expected 7 joints to " + palm_link +
                             ", found " + std::to_string(chain.size()));
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = chain[i]->name;
  return names;
}

}  // namespace coglab_sim::plant
