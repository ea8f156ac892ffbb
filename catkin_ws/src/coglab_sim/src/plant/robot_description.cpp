#include "robot_description.hpp"

#include <algorithm>
#include <set>
#include <sstream>
#include <stdexcept>

#include <tinyxml2.h>

namespace coglab_sim::plant {
namespace {

using tinyxml2::XMLElement;

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path) {
    if (document_.LoadFile(path.c_str()) != tinyxml2::XML_SUCCESS)
      throw std::runtime_error("robot description " + path +
                               " cannot be read as a URDF: " + document_.ErrorStr());
    robot_ = document_.FirstChildElement("robot");
    if (robot_ == nullptr)
      throw std::runtime_error("robot description " + path +
                               " cannot be read as a URDF: it has no element 'robot'");
  }

  RobotDescription read() {
    RobotDescription robot;
    robot.path = path_;
    for (const auto* e = robot_->FirstChildElement("link"); e; e = e->NextSiblingElement("link")) {
      Link link = linkOf(*e);
      robot.links[link.name] = link;
    }
    std::set<std::string> children;
    for (const auto* e = robot_->FirstChildElement("joint"); e;
         e = e->NextSiblingElement("joint")) {
      robot.joints.push_back(jointOf(*e));
      const Joint& joint = robot.joints.back();
      for (const std::string& name : {joint.parent, joint.child}) {
        if (robot.links.count(name) == 0) fail(*e, "names the link '" + name + "', there is none");
      }
      if (!children.insert(joint.child).second) fail(*e, "is the second one of its child link");
    }
    for (const auto& [name, link] : robot.links) {
      if (children.count(name) != 0) continue;
      if (!robot.root.empty())
        throw std::runtime_error("robot description " + path_ + " has two root links, " +
                                 robot.root + " and " + name);
      robot.root = name;
    }
    if (robot.root.empty())
      throw std::runtime_error("robot description " + path_ + " has no root link");
    return robot;
  }

 private:
  [[noreturn]] void fail(const XMLElement& element, const std::string& what) const {
    const char* name = element.Attribute("name");
    throw std::runtime_error("robot description " + path_ + ":" +
                             std::to_string(element.GetLineNum()) + ": " + element.Name() +
                             (name != nullptr ? " '" + std::string(name) + "'" : "") + " " + what);
  }

  std::string attribute(const XMLElement& element, const char* key) const {
    const char* value = element.Attribute(key);
    if (value == nullptr) fail(element, "has no attribute '" + std::string(key) + "'");
    return value;
  }

  double number(const XMLElement& element, const char* key) const {
    double value = 0.0;
    if (element.QueryDoubleAttribute(key, &value) != tinyxml2::XML_SUCCESS)
      fail(element, "needs a number as '" + std::string(key) + "'");
    return value;
  }

  Vector3d vector(const XMLElement& element, const char* key, const Vector3d& otherwise) const {
    const char* text = element.Attribute(key);
    if (text == nullptr) return otherwise;
    std::istringstream stream(text);
    Vector3d value;
    if (!(stream >> value.x() >> value.y() >> value.z()))
      fail(element, "needs three numbers as '" + std::string(key) + "'");
    return value;
  }

  Pose originOf(const XMLElement& element) const {
    const XMLElement* origin = element.FirstChildElement("origin");
    if (origin == nullptr) return {};
    const Vector3d rpy = vector(*origin, "rpy", Vector3d::Zero());
    return {vector(*origin, "xyz", Vector3d::Zero()),
            Eigen::AngleAxisd(rpy.z(), Vector3d::UnitZ()) *
                Eigen::AngleAxisd(rpy.y(), Vector3d::UnitY()) *
                Eigen::AngleAxisd(rpy.x(), Vector3d::UnitX())};
  }

  Solid solidOf(const XMLElement& collision) const {
    Solid solid;
    solid.pose = originOf(collision);
    const XMLElement* geometry = collision.FirstChildElement("geometry");
    const XMLElement* shape = geometry != nullptr ? geometry->FirstChildElement() : nullptr;
    if (shape == nullptr) fail(collision, "has no geometry");
    solid.kind = shape->Name();
    if (solid.kind == "box") {
      solid.size = 0.5 * vector(*shape, "size", Vector3d::Zero());
    } else if (solid.kind == "cylinder") {
      solid.size = {number(*shape, "radius"), 0.5 * number(*shape, "length"), 0.0};
    } else if (solid.kind == "sphere") {
      solid.size = {number(*shape, "radius"), 0.0, 0.0};
    } else {
      fail(*shape, "is no shape for contacts; expected box, cylinder or sphere");
    }
    return solid;
  }

  Link linkOf(const XMLElement& element) const {
    Link link;
    link.name = attribute(element, "name");
    if (const auto* inertial = element.FirstChildElement("inertial")) {
      const XMLElement* mass = inertial->FirstChildElement("mass");
      const XMLElement* tensor = inertial->FirstChildElement("inertia");
      if (mass == nullptr || tensor == nullptr) fail(element, "has no mass or no inertia");
      link.has_inertia = true;
      link.mass = number(*mass, "value");
      link.inertia_frame = originOf(*inertial);
      const double xy = number(*tensor, "ixy"), xz = number(*tensor, "ixz"),
                   yz = number(*tensor, "iyz");
      link.inertia << number(*tensor, "ixx"), xy, xz, xy, number(*tensor, "iyy"), yz, xz, yz,
          number(*tensor, "izz");
    }
    for (const auto* e = element.FirstChildElement("collision"); e;
         e = e->NextSiblingElement("collision"))
      link.collisions.push_back(solidOf(*e));
    return link;
  }

  Joint jointOf(const XMLElement& element) const {
    Joint joint;
    joint.name = attribute(element, "name");
    joint.type = attribute(element, "type");
    static const std::set<std::string> kTypes = {"fixed", "revolute", "continuous", "prismatic"};
    if (kTypes.count(joint.type) == 0) fail(element, "has the unknown type '" + joint.type + "'");
    const XMLElement* parent = element.FirstChildElement("parent");
    const XMLElement* child = element.FirstChildElement("child");
    if (parent == nullptr || child == nullptr) fail(element, "has no parent or no child");
    joint.parent = attribute(*parent, "link");
    joint.child = attribute(*child, "link");
    joint.origin = originOf(element);
    if (const auto* axis = element.FirstChildElement("axis"))
      joint.axis = vector(*axis, "xyz", joint.axis);
    if (const auto* limit = element.FirstChildElement("limit"); limit != nullptr) {
      joint.lower = limit->DoubleAttribute("lower");
      joint.upper = limit->DoubleAttribute("upper");
    }
    if (const auto* dynamics = element.FirstChildElement("dynamics"); dynamics != nullptr)
      joint.damping = dynamics->DoubleAttribute("damping");
    return joint;
  }

  std::string path_;
  tinyxml2::XMLDocument document_;
  const XMLElement* robot_ = nullptr;
};

}  // namespace

std::vector<const Joint*> RobotDescription::below(const std::string& link) const {
  std::vector<const Joint*> found;
  for (const Joint& joint : joints) {
    if (joint.parent == link) found.push_back(&joint);
  }
  return found;
}

MassMoment RobotDescription::withMovableLinks(const std::string& link) const {
  const Link& first = links.at(link);
  MassMoment sum{first.mass, first.mass * first.inertia_frame.position};
  for (const Joint* joint : below(link)) {
    if (!joint->moves()) continue;
    const MassMoment more = withMovableLinks(joint->child);
    sum.mass += more.mass;
    sum.moment += more.mass * joint->origin.position + joint->origin.rotation * more.moment;
  }
  return sum;
}

std::vector<const Joint*> RobotDescription::chainTo(const std::string& link) const {
  if (links.count(link) == 0)
    throw std::runtime_error("robot description " + path + " has no link '" + link + "'");
  std::vector<const Joint*> chain;
  std::string at = link;
  while (at != root) {
    const auto joint =
        std::find_if(joints.begin(), joints.end(), [&](const Joint& j) { return j.child == at; });
    if (joint == joints.end() || chain.size() > links.size())
      throw std::runtime_error("robot description " + path + ": '" + link +
                               "' does not hang below the root link");
    if (joint->moves()) chain.insert(chain.begin(), &*joint);
    at = joint->parent;
  }
  return chain;
}

RobotDescription readRobotDescription(const std::string& path) { return Reader(path).read(); }

}  // namespace coglab_sim::plant
