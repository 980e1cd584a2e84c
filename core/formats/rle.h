#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// COCO run-length encoding: lengths of alternating runs of 0 and 1, beginning with 0 (possibly
// empty), down the columns of the mask, column after column. The compressed form writes a length as
// its difference to the one two places before, in digits of five bits, as printable characters.
std::string EncodeCocoRle(const BinaryMask& mask, int width, int height);

// The counts of the compressed form. INVALID_ARGUMENT: not such a string, or more than
// `max_counts`.
absl::StatusOr<std::vector<int64_t>> ParseCocoCounts(
    absl::string_view compressed, int64_t max_counts = std::numeric_limits<int64_t>::max());

// Row-major indices y * width + x of the pixels that the runs cover, each once, in the runs' order.
// INVALID_ARGUMENT: a run is negative, or they do not add up to width * height.
absl::StatusOr<std::vector<uint32_t>> PixelsOfRuns(std::span<const int64_t> counts, int width,
                                                   int height);

}  // namespace pepeseg
