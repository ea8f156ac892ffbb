/// @file
/// Strict reading of one XML element for library.cpp: every attribute known, present once and a
/// finite number.
#pragma once

#include <set>
#include <string>

#include <tinyxml2.h>

#include "coglab_controllers/dmp/library.hpp"

namespace coglab_controllers::library_xml {

/// Throws LibraryError "file:line: text".
[[noreturn]] void fail(const std::string& file, int line, const std::string& text);

/// An element whose attributes have been checked against a list.
class Element {
 public:
  /// @throws LibraryError for an attribute that is not in the list or there twice.
  Element(const std::string& file, const tinyxml2::XMLElement& element,
          const std::set<std::string>& attributes);

  bool has(const char* name) const { return element_.Attribute(name) != nullptr; }
  std::string text(const char* name) const;  ///< @throws LibraryError if missing
  double number(
      const char* name) const;  ///< @throws LibraryError if missing or not one finite number
  double number(const char* name, double otherwise) const;
  int integer(const char* name, int otherwise) const;
  Vector3 point(const char* name) const;  ///< three finite numbers with blanks between
  Vector3 point(const char* name, const Vector3& otherwise) const;
  [[noreturn]] void fail(const std::string& text) const;
  const tinyxml2::XMLElement& xml() const { return element_; }

 private:
  const std::string& file_;
  const tinyxml2::XMLElement& element_;
};

/// Refuses text, document types and anything else that is not an element or a comment below a node.
void requireElementsOnly(const std::string& file, const tinyxml2::XMLNode& node);

/// Shortest decimal that reads back as the same double.
std::string exact(double value);
std::string exact(const Vector3& point);

}  // namespace coglab_controllers::library_xml
