#include "library_xml.hpp"

#include <charconv>
#include <cmath>
#include <cstring>

namespace coglab_controllers::library_xml {
namespace {

// Reads one finite number at `text`, moves `text` behind it.
bool readNumber(const char*& text, double& value) {
  while (*text == ' ' || *text == '\t' || *text == '\n') ++text;
  const char* end = text + std::strlen(text);
  const auto [rest, error] = std::from_chars(text, end, value);
  if (error != std::errc() || !std::isfinite(value)) return false;
  text = rest;
  return *text == '\0' || *text == ' ' || *text == '\t' || *text == '\n';
}

bool atEnd(const char* text) {
  while (*text == ' ' || *text == '\t' || *text == '\n') ++text;
  return *text == '\0';
}

std::string shortened(const std::string& text) {
  return text.size() > 60 ? text.substr(0, 57) + "..." : text;
}

}  // namespace

void fail(const std::string& file, int line, const std::string& text) {
  throw LibraryError(file + ":" + std::to_string(line) + ": " + text);
}

Element::Element(const std::string& file, const tinyxml2::XMLElement& element,
                 const std::set<std::string>& attributes)
    : file_(file), element_(element) {
  std::set<std::string> seen;
  for (const auto* a = element.FirstAttribute(); a != nullptr; a = a->Next()) {
    if (attributes.count(a->Name()) == 0) {
      std::string known;
      for (const std::string& name : attributes) known += (known.empty() ? "" : ", ") + name;
      fail("unknown attribute '" + shortened(a->Name()) + "', expected " +
           (known.empty() ? "none" : known));
    }
    if (!seen.insert(a->Name()).second)
      fail("attribute '" + std::string(a->Name()) + "' is there twice");
  }
}

void Element::fail(const std::string& text) const {
  library_xml::fail(file_, element_.GetLineNum(),
                    "<" + std::string(element_.Name()) + ">: " + text);
}

std::string Element::text(const char* name) const {
  const char* value = element_.Attribute(name);
  if (value == nullptr) fail("attribute '" + std::string(name) + "' is missing");
  return value;
}

double Element::number(const char* name) const {
  const std::string value = text(name);
  const char* at = value.c_str();
  double number = 0.0;
  if (!readNumber(at, number) || !atEnd(at)) {
    fail(std::string(name) + ": expected one finite number, got '" + shortened(value) + "'");
  }
  return number;
}

double Element::number(const char* name, double otherwise) const {
  return has(name) ? number(name) : otherwise;
}

int Element::integer(const char* name, int otherwise) const {
  if (!has(name)) return otherwise;
  const double value = number(name);
  if (value != std::floor(value) || std::abs(value) > 1e6) {
    fail(std::string(name) + ": expected a whole number, got '" + shortened(text(name)) + "'");
  }
  return static_cast<int>(value);
}

Vector3 Element::point(const char* name) const {
  const std::string value = text(name);
  const char* at = value.c_str();
  Vector3 point;
  if (!readNumber(at, point[0]) || !readNumber(at, point[1]) || !readNumber(at, point[2]) ||
      !atEnd(at)) {
    fail(std::string(name) + ": expected three finite numbers, got '" + shortened(value) + "'");
  }
  return point;
}

Vector3 Element::point(const char* name, const Vector3& otherwise) const {
  return has(name) ? point(name) : otherwise;
}

void requireElementsOnly(const std::string& file, const tinyxml2::XMLNode& node) {
  for (const auto* child = node.FirstChild(); child != nullptr; child = child->NextSibling()) {
    if (child->ToElement() != nullptr || child->ToComment() != nullptr) continue;
    if (child->ToUnknown() != nullptr) {
      fail(
          file, child->GetLineNum(),
          "document types and entities are refused, remove '<!" + shortened(child->Value()) + ">'");
    }
    if (child->ToDeclaration() != nullptr && node.ToDocument() != nullptr) continue;
    fail(file, child->GetLineNum(), "expected elements, got '" + shortened(child->Value()) + "'");
  }
}

std::string exact(double value) {
  char buffer[40];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value);
  return std::string(buffer, end);
}

std::string exact(const Vector3& point) {
  return exact(point.x()) + " " + exact(point.y()) + " " + exact(point.z());
}

}  // namespace coglab_controllers::library_xml
