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

// Encodes a mask [height, width] in COCO's compressed run-length encoding. Runs of 0 and 1
// alternate, beginning with a (possibly empty) run of 0, down the columns of the mask, column after
// column. From the fourth run on, the difference to the run two before it is stored. A number is
// written in digits of 5 bits, the lowest first, each as a printable character with a bit for "more
// digits follow".
std::string EncodeCocoRle(const BinaryMask& mask, int width, int height);

// Compresses run lengths in the same way.
std::string EncodeCocoCounts(std::span<const int64_t> counts);

// Decodes the run lengths of the compressed form. INVALID_ARGUMENT: the string is malformed, a
// length is negative or above INT32_MAX, or there are more than `max_counts` runs.
absl::StatusOr<std::vector<int64_t>> ParseCocoCounts(
    absl::string_view compressed, int64_t max_counts = std::numeric_limits<int64_t>::max());

// Returns the indices y * width + x of the pixels that the runs of 1 cover, each once, in the order
// of the runs. INVALID_ARGUMENT: a run is negative, or the runs do not add up to width * height.
absl::StatusOr<std::vector<uint32_t>> PixelsOfRuns(std::span<const int64_t> counts, int width,
                                                   int height);

}  // namespace pepeseg
