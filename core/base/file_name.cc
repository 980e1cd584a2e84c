#include "core/base/file_name.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxNameBytes = 1024;

// Returns the length in bytes of the UTF-8 sequence at the front of `text`, or 0 if it is not
// valid: overlong forms, surrogates and code points above U+10FFFF are not (RFC 3629).
size_t Utf8SequenceLength(absl::string_view text) {
  const auto lead = static_cast<unsigned char>(text[0]);
  size_t length = 1;
  if (lead >= 0x80) length = lead < 0xC2 ? 0 : lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : 4;
  if (lead > 0xF4 || length == 0 || length > text.size()) return 0;
  for (size_t i = 1; i < length; ++i) {
    if ((static_cast<unsigned char>(text[i]) & 0xC0) != 0x80) return 0;
  }
  if (length < 3) return length;
  const auto second = static_cast<unsigned char>(text[1]);
  // The second byte decides whether a shorter sequence would do, and whether the code point is a
  // surrogate or above U+10FFFF.
  const bool overlong = (lead == 0xE0 && second < 0xA0) || (lead == 0xF0 && second < 0x90);
  const bool out_of_range = (lead == 0xED && second > 0x9F) || (lead == 0xF4 && second > 0x8F);
  return overlong || out_of_range ? 0 : length;
}

bool IsUtf8(absl::string_view text) {
  while (!text.empty()) {
    const size_t length = Utf8SequenceLength(text);
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

// Returns the position of the suffix's dot, or the size of the name if it has no suffix.
size_t SuffixStart(absl::string_view name) {
  const size_t slash = name.rfind('/');
  const size_t first = slash == absl::string_view::npos ? 0 : slash + 1;
  const size_t dot = name.rfind('.');
  return dot == absl::string_view::npos || dot <= first ? name.size() : dot;
}

// Returns the error for a name. Escapes it, because it may hold control characters, and shortens
// it.
absl::Status BadName(absl::string_view name, absl::string_view why) {
  return absl::InvalidArgumentError(
      absl::StrCat("file name \"", absl::CEscape(name.substr(0, kMaxNameBytes)), "\" ", why));
}

}  // namespace

absl::Status ValidateName(absl::string_view name) {
  if (name.empty()) return BadName(name, "is empty");
  if (name.size() > kMaxNameBytes) return BadName(name, "... is longer than 1024 bytes");
  if (std::any_of(name.begin(), name.end(), absl::ascii_iscntrl)) {
    return BadName(name, "has a control character");
  }
  if (!IsUtf8(name)) return BadName(name, "is not UTF-8");
  if (name.front() == '/') return BadName(name, "is absolute; a relative one is needed");
  for (const absl::string_view part : absl::StrSplit(name, '/')) {
    if (part.empty()) return BadName(name, "has an empty part");
    if (part == "." || part == "..") return BadName(name, "has \".\" or \"..\" in it");
  }
  return absl::OkStatus();
}

absl::string_view WithoutFolder(absl::string_view name, absl::string_view folder) {
  absl::string_view rest = name;
  if (absl::ConsumePrefix(&rest, folder) && absl::ConsumePrefix(&rest, "/")) return rest;
  return name;
}

absl::string_view WithoutSuffix(absl::string_view name) {
  return name.substr(0, SuffixStart(name));
}

std::string Suffix(absl::string_view name) {
  return absl::AsciiStrToLower(name.substr(SuffixStart(name)));
}

bool IsSystemFile(absl::string_view name) {
  for (const absl::string_view part : absl::StrSplit(name, '/')) {
    if (!part.empty() && part.front() == '.') return true;
    for (const char* known : {"thumbs.db", "desktop.ini", "__macosx", "@eadir", "#recycle",
                              "$recycle.bin", "lost+found"}) {
      if (absl::EqualsIgnoreCase(part, known)) return true;
    }
  }
  return false;
}

}  // namespace pepeseg
