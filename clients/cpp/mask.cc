#include "clients/cpp/mask.h"

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace pepeseg::client {
absl::StatusOr<Mask> DecodeRle(const v1::CocoRle& rle) {
  const int64_t height = rle.height();
  const int64_t num_pixels = height * rle.width();
  if (height < 0 || rle.width() < 0 || num_pixels > (int64_t{1} << 30)) {
    return absl::DataLossError(absl::StrCat("mask of ", rle.width(), "x", height, " pixels"));
  }
  Mask mask(static_cast<size_t>(num_pixels), 0);
  std::vector<int64_t> runs;
  int64_t filled = 0;
  for (size_t i = 0; i < rle.counts().size();) {
    // Five bits a character, lowest first; bit 5: more follow; bit 4 of the last: negative.
    int64_t run = 0;
    int shift = 0;
    bool more = true;
    while (more && i < rle.counts().size() && shift < 60) {
      const int symbol = rle.counts()[i++] - '0';
      run |= static_cast<int64_t>(symbol & 31) << shift;
      more = (symbol & 32) != 0;
      shift += 5;
      if (!more && (symbol & 16) != 0) run |= -(int64_t{1} << shift);
    }
    if (runs.size() > 2) run += runs[runs.size() - 2];
    if (more || run < 0 || run > num_pixels - filled) {
      return absl::DataLossError(absl::StrCat("mask: run ", runs.size(), " is of ", run,
                                              " pixels, ", num_pixels - filled, " are left"));
    }
    for (int64_t k = filled; runs.size() % 2 == 1 && k < filled + run; ++k) {
      mask[static_cast<size_t>((k % height) * rle.width() + k / height)] = 1;
    }
    filled += run;
    runs.push_back(run);
  }
  if (filled != num_pixels) {
    return absl::DataLossError(
        absl::StrCat("mask: runs of ", filled, " pixels in all, not ", num_pixels));
  }
  return mask;
}

}  // namespace pepeseg::client
