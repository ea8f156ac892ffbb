#include "coglab_controllers/dmp/library.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <sstream>
#include <vector>

#include "coglab_controllers/dmp/learning.hpp"
#include "library_xml.hpp"

namespace coglab_controllers {
namespace {

using library_xml::Element;
using library_xml::exact;

constexpr int kVersion = 1;
constexpr int kMaxTrajectories = 50;

GoalWeight readGoalWeight(const Element& element) {
  GoalWeight weight;
  const std::string kind = element.text("kind");
  if (kind == "linear") {
    if (element.has("centre") || element.has("steepness"))
      element.fail("centre and steepness need kind=\"sigmoid\"");
    return weight;
  }
  if (kind != "sigmoid") element.fail("kind: expected linear or sigmoid, got '" + kind + "'");
  weight.kind = GoalWeight::Kind::Sigmoid;
  weight.centre = element.number("centre");
  weight.steepness = element.number("steepness");
  return weight;
}

ShapeMapping readMapping(const Element& element) {
  try {
    return toShapeMapping(element.text("mapping"));
  } catch (const std::invalid_argument& error) {
    element.fail(error.what());
  }
}

Trajectory readTrajectory(const std::string& file, const tinyxml2::XMLElement& xml) {
  const Element element(file, xml, {});
  library_xml::requireElementsOnly(file, xml);
  std::vector<Vector3> positions;
  Trajectory trajectory;
  for (const auto* child = xml.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    const Element sample(file, *child, {"t", "position"});
    if (std::string(child->Name()) != "sample") sample.fail("expected <sample>");
    library_xml::requireElementsOnly(file, *child);
    trajectory.times.push_back(sample.number("t"));
    positions.push_back(sample.point("position"));
    if (trajectory.times.size() > static_cast<std::size_t>(Library::kMaxSamples)) {
      element.fail("expected at most " + std::to_string(Library::kMaxSamples) + " samples");
    }
  }
  trajectory.positions.resize(3, static_cast<Eigen::Index>(positions.size()));
  for (std::size_t i = 0; i < positions.size(); ++i) {
    trajectory.positions.col(static_cast<Eigen::Index>(i)) = positions[i];
  }
  try {
    validate(trajectory);
  } catch (const std::invalid_argument& error) {
    element.fail(error.what());
  }
  return trajectory;
}

// Children of one <primitive>, each kind at most once but for basis and trajectory.
class PrimitiveReader {
 public:
  PrimitiveReader(const std::string& file, const tinyxml2::XMLElement& xml)
      : file_(file), element_(file, xml, {"id", "description"}) {
    library_xml::requireElementsOnly(file, xml);
    for (const auto* child = xml.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement()) {
      const std::string name = child->Name();
      if (name == "basis") {
        basis_.push_back(child);
      } else if (name == "trajectory") {
        trajectories_.push_back(child);
      } else if (!once_.emplace(name, child).second) {
        library_xml::fail(file, child->GetLineNum(), "<" + name + "> is there twice");
      }
    }
  }

  Primitive read() {
    try {
      Primitive primitive = once_.count("learn") != 0 ? learnt() : weighted();
      primitive.id = element_.text("id");
      if (element_.has("description")) primitive.description = element_.text("description");
      validate(primitive);
      return primitive;
    } catch (const std::invalid_argument& error) {
      element_.fail(error.what());
    }
  }

 private:
  Element child(const std::string& name, const std::set<std::string>& attributes) {
    const auto found = once_.find(name);
    if (found == once_.end()) element_.fail("<" + name + "> is missing");
    library_xml::requireElementsOnly(file_, *found->second);
    const Element result(file_, *found->second, attributes);
    once_.erase(found);
    return result;
  }

  void requireNothingLeft() {
    if (once_.empty()) return;
    const auto& [name, xml] = *once_.begin();
    library_xml::fail(file_, xml->GetLineNum(),
                      "unexpected <" + name.substr(0, 60) + "> in <primitive>");
  }

  Primitive weighted() {
    Primitive primitive;
    const Element system = child("system", {"duration", "alpha", "stiffness", "damping"});
    primitive.duration = system.number("duration");
    primitive.alpha = system.number("alpha");
    primitive.stiffness = system.number("stiffness");
    primitive.damping = system.number("damping");
    primitive.goal_weight = readGoalWeight(child("goal_weight", {"kind", "centre", "steepness"}));
    primitive.mapping = readMapping(child("shape", {"mapping"}));
    const Element start = child("start", {"position", "velocity"});
    primitive.start = start.point("position");
    primitive.start_velocity = start.point("velocity", Vector3::Zero());
    primitive.goal = child("goal", {"position"}).point("position");
    if (!trajectories_.empty()) element_.fail("<trajectory> needs a <learn> beside it");
    if (basis_.size() > static_cast<std::size_t>(kMaxBasis)) {
      element_.fail("expected at most " + std::to_string(kMaxBasis) + " <basis>, got " +
                    std::to_string(basis_.size()));
    }
    const auto count = static_cast<Eigen::Index>(basis_.size());
    primitive.centres.resize(count);
    primitive.widths.resize(count);
    primitive.weights.resize(3, count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const auto* xml = basis_[static_cast<std::size_t>(i)];
      const Element basis(file_, *xml, {"centre", "width", "weight"});
      library_xml::requireElementsOnly(file_, *xml);
      primitive.centres[i] = basis.number("centre");
      primitive.widths[i] = basis.number("width");
      primitive.weights.col(i) = basis.point("weight");
    }
    requireNothingLeft();
    return primitive;
  }

  Primitive learnt() {
    LearningOptions options;
    const Element element =
        child("learn", {"basis", "alpha", "stiffness", "regularisation", "allow"});
    options.basis_count = element.integer("basis", options.basis_count);
    options.alpha = element.number("alpha", options.alpha);
    options.stiffness = element.number("stiffness", options.stiffness);
    options.regularisation = element.number("regularisation", options.regularisation);
    std::istringstream allow(element.has("allow") ? element.text("allow") : "");
    for (std::string fault; allow >> fault;) options.allow.push_back(fault);
    if (once_.count("goal_weight") != 0) {
      options.goal_weight = readGoalWeight(child("goal_weight", {"kind", "centre", "steepness"}));
    }
    if (once_.count("shape") != 0) options.mapping = readMapping(child("shape", {"mapping"}));
    if (!basis_.empty())
      element_.fail("expected either <learn> with <trajectory> or <basis>, got both");
    if (trajectories_.size() > static_cast<std::size_t>(kMaxTrajectories)) {
      element_.fail("expected at most " + std::to_string(kMaxTrajectories) + " trajectories");
    }
    std::vector<Trajectory> demonstrations;
    for (const auto* xml : trajectories_) demonstrations.push_back(readTrajectory(file_, *xml));
    requireNothingLeft();
    return learn(element_.text("id"), demonstrations, options);
  }

  const std::string& file_;
  Element element_;
  std::map<std::string, const tinyxml2::XMLElement*> once_;
  std::vector<const tinyxml2::XMLElement*> basis_, trajectories_;
};

void print(tinyxml2::XMLPrinter& printer, const Primitive& primitive) {
  const auto attribute = [&](const char* name, const std::string& value) {
    printer.PushAttribute(name, value.c_str());
  };
  printer.OpenElement("primitive");
  attribute("id", primitive.id);
  if (!primitive.description.empty()) attribute("description", primitive.description);
  printer.OpenElement("system");
  attribute("duration", exact(primitive.duration));
  attribute("alpha", exact(primitive.alpha));
  attribute("stiffness", exact(primitive.stiffness));
  attribute("damping", exact(primitive.damping));
  printer.CloseElement();
  printer.OpenElement("goal_weight");
  const bool sigmoid = primitive.goal_weight.kind == GoalWeight::Kind::Sigmoid;
  attribute("kind", sigmoid ? "sigmoid" : "linear");
  if (sigmoid) {
    attribute("centre", exact(primitive.goal_weight.centre));
    attribute("steepness", exact(primitive.goal_weight.steepness));
  }
  printer.CloseElement();
  printer.OpenElement("shape");
  attribute("mapping", describe(primitive.mapping));
  printer.CloseElement();
  printer.OpenElement("start");
  attribute("position", exact(primitive.start));
  attribute("velocity", exact(primitive.start_velocity));
  printer.CloseElement();
  printer.OpenElement("goal");
  attribute("position", exact(primitive.goal));
  printer.CloseElement();
  for (Eigen::Index i = 0; i < primitive.centres.size(); ++i) {
    printer.OpenElement("basis");
    attribute("centre", exact(primitive.centres[i]));
    attribute("width", exact(primitive.widths[i]));
    attribute("weight", exact(Vector3(primitive.weights.col(i))));
    printer.CloseElement();
  }
  printer.CloseElement();
}

}  // namespace

int Library::load(const std::string& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0)
    throw LibraryError(path + ":0: cannot be read; expected an existing file");
  if (!S_ISREG(info.st_mode)) throw LibraryError(path + ":0: expected a regular file");
  if (static_cast<std::size_t>(info.st_size) > kMaxFileBytes) {
    throw LibraryError(path + ":0: expected at most " + std::to_string(kMaxFileBytes) +
                       " bytes, got " + std::to_string(info.st_size));
  }
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) throw LibraryError(path + ":0: cannot be read; check its permissions");
  return parse(text.str(), path);
}

int Library::parse(const std::string& text, const std::string& name) {
  if (text.size() > kMaxFileBytes) {
    throw LibraryError(name + ":0: expected at most " + std::to_string(kMaxFileBytes) +
                       " bytes, got " + std::to_string(text.size()));
  }
  if (text.find('\0') != std::string::npos)
    throw LibraryError(name + ":0: expected text, got a zero byte");
  tinyxml2::XMLDocument document;
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
    library_xml::fail(name, document.ErrorLineNum(),
                      "expected XML, got " + std::string(document.ErrorName()));
  }
  library_xml::requireElementsOnly(name, document);
  const tinyxml2::XMLElement* root = document.RootElement();
  if (root == nullptr || std::string(root->Name()) != "dmp_library") {
    library_xml::fail(name, root == nullptr ? 1 : root->GetLineNum(),
                      "expected <dmp_library> as the root element");
  }
  if (const auto* second = root->NextSiblingElement()) {
    library_xml::fail(name, second->GetLineNum(),
                      "expected one root element, got <" + std::string(second->Name()) + ">");
  }
  const Element element(name, *root, {"version"});
  if (element.integer("version", 0) != kVersion) {
    element.fail("version: expected " + std::to_string(kVersion) + ", got '" +
                 (element.has("version") ? element.text("version") : "") + "'");
  }
  library_xml::requireElementsOnly(name, *root);
  std::map<std::string, Primitive> read;
  for (const auto* child = root->FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    if (std::string(child->Name()) != "primitive") {
      library_xml::fail(name, child->GetLineNum(),
                        "expected <primitive>, got <" + std::string(child->Name()) + ">");
    }
    Primitive primitive = PrimitiveReader(name, *child).read();
    const std::string id = primitive.id;
    if (!read.emplace(id, std::move(primitive)).second) {
      library_xml::fail(name, child->GetLineNum(), "primitive '" + id + "' is there twice");
    }
    if (static_cast<int>(read.size()) > kMaxPrimitives) {
      library_xml::fail(name, child->GetLineNum(),
                        "expected at most " + std::to_string(kMaxPrimitives) + " primitives");
    }
  }
  if (read.empty())
    library_xml::fail(name, root->GetLineNum(), "expected at least one <primitive>");
  const int count = static_cast<int>(read.size());
  for (auto& [id, primitive] : read) primitives_.insert_or_assign(id, std::move(primitive));
  return count;
}

std::string Library::format() const {
  tinyxml2::XMLPrinter printer;
  printer.PushHeader(false, true);
  printer.OpenElement("dmp_library");
  printer.PushAttribute("version", kVersion);
  for (const auto& [id, primitive] : primitives_) print(printer, primitive);
  printer.CloseElement();
  return std::string(printer.CStr()) + "\n";
}

void Library::save(const std::string& path) const {
  if (primitives_.empty())
    throw LibraryError(path + ":0: expected at least one primitive to write");
  const std::string temporary = path + ".part" + std::to_string(::getpid());
  {
    std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
    file << format();
    if (!file.flush()) {
      std::remove(temporary.c_str());
      throw LibraryError(
          path + ":0: cannot be written; check that the folder exists and may be written to");
    }
  }
  if (std::rename(temporary.c_str(), path.c_str()) != 0) {
    std::remove(temporary.c_str());
    throw LibraryError(path + ":0: cannot be replaced");
  }
}

void Library::add(const Primitive& primitive) {
  validate(primitive);
  primitives_.insert_or_assign(primitive.id, primitive);
}

const Primitive* Library::find(const std::string& id) const noexcept {
  const auto found = primitives_.find(id);
  return found == primitives_.end() ? nullptr : &found->second;
}

const Primitive& Library::at(const std::string& id) const {
  if (const Primitive* primitive = find(id)) return *primitive;
  std::string known;
  for (const auto& [name, primitive] : primitives_) known += (known.empty() ? "" : ", ") + name;
  throw std::invalid_argument("primitive '" + id.substr(0, 64) + "' is unknown; loaded are: " +
                              (known.empty() ? "none, call load_dmps first" : known));
}

}  // namespace coglab_controllers
