/// @file
/// Recognizes the file of a library that is cut short, before the dynamic linker opens it.
#pragma once

#include <elf.h>
#include <link.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

namespace coglab_rt {

/// The dynamic linker maps the sizes in a library's headers. An access beyond the end of the file
/// then ends the process (SIGBUS).
/// @param file path of a library
/// @return what is wrong and what to do, without the name of the file; empty if the file has the
/// length in its headers, or is none that the linker accepts
inline std::string cutShort(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  ElfW(Ehdr) header{};
  in.read(reinterpret_cast<char*>(&header), sizeof header);
  const unsigned char native = sizeof(void*) == 8 ? ELFCLASS64 : ELFCLASS32;
  if (!in || std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0 ||
      header.e_ident[EI_CLASS] != native) {
    return "";
  }
  std::uint64_t announced = header.e_shoff + std::uint64_t{header.e_shentsize} * header.e_shnum;
  in.seekg(static_cast<std::streamoff>(header.e_phoff));
  for (int i = 0; i < header.e_phnum && in; ++i) {
    ElfW(Phdr) part{};
    in.read(reinterpret_cast<char*>(&part), sizeof part);
    if (part.p_type == PT_LOAD) {
      announced = std::max<std::uint64_t>(announced, part.p_offset + part.p_filesz);
    }
  }
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(file, error);
  if (error || (in && announced <= size)) return "";
  return "is cut short: it has " + std::to_string(size) + " of " + std::to_string(announced) +
         " bytes; build it again";
}

}  // namespace coglab_rt
