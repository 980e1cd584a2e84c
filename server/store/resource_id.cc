#include "server/store/resource_id.h"

#include <algorithm>

#include "absl/strings/ascii.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxIdBytes = 63;

}  // namespace

bool IsRfc1034Label(std::string_view id) {
  if (id.empty() || id.size() > kMaxIdBytes || !absl::ascii_islower(id.front()) ||
      id.back() == '-') {
    return false;
  }
  return std::all_of(id.begin(), id.end(), [](unsigned char c) {
    return absl::ascii_islower(c) || absl::ascii_isdigit(c) || c == '-';
  });
}

bool IsResourceId(std::string_view id) {
  if (id.empty() || id.size() > kMaxIdBytes || !absl::ascii_isalnum(id.front())) return false;
  return std::all_of(id.begin(), id.end(), [](unsigned char c) {
    return absl::ascii_isalnum(c) || c == '_' || c == '.' || c == '-';
  });
}

}  // namespace pepeseg
