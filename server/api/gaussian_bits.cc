#include "server/api/gaussian_bits.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "server/api/error.h"

namespace pepeseg {
namespace {

size_t NumBytes(int64_t num_gaussians) { return static_cast<size_t>((num_gaussians + 7) / 8); }

}  // namespace

absl::StatusOr<GaussianSet> SetFromProto(const v1::GaussianBits& bits, int64_t num_gaussians,
                                         const std::string& field) {
  const std::string& bytes = bits.bits();
  if (bytes.size() != NumBytes(num_gaussians)) {
    return BadField(field, absl::StrCat(bytes.size()),
                    absl::StrCat("bytes; the model has ", num_gaussians, " Gaussians, which take ",
                                 NumBytes(num_gaussians), " bytes"));
  }
  const auto is_set = [&bytes](int64_t i) {
    return static_cast<uint8_t>(bytes[i / 8] >> (i % 8)) & 1;
  };
  for (int64_t i = num_gaussians; i < static_cast<int64_t>(8 * bytes.size()); ++i) {
    if (is_set(i) == 0) continue;
    return BadField(field, absl::StrCat("bit ", i),
                    absl::StrCat("is 1; the model has ", num_gaussians,
                                 " Gaussians, and the bits beyond the last must be 0"));
  }
  GaussianSet set;
  set.member.resize(num_gaussians);
  for (int64_t i = 0; i < num_gaussians; ++i) set.member[i] = is_set(i);
  return set;
}

v1::GaussianBits ToProto(const GaussianSet& set) {
  std::string bytes(NumBytes(static_cast<int64_t>(set.member.size())), '\0');
  for (size_t i = 0; i < set.member.size(); ++i) {
    if (set.member[i] != 0) bytes[i / 8] = static_cast<char>(bytes[i / 8] | 1 << (i % 8));
  }
  v1::GaussianBits bits;
  bits.set_bits(std::move(bytes));
  return bits;
}

}  // namespace pepeseg
