#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/find/word_votes.h"

namespace pepeseg {

// Most things that a program may find in a photograph, and the largest file that has them.
inline constexpr size_t kMostTextThings = 200;
inline constexpr int64_t kMaxTextAnswerBytes = int64_t{16} << 20;

// The photograph that a program has searched, and the grid of the view that it shows.
struct SearchedPhotograph {
  int width = 0, height = 0;            // pixels
  int grid_width = 0, grid_height = 0;  // at most those of the photograph
};

// Parses what the operator's program has found in a photograph, in the format of text_task.h: word
// 0 of each. Boxes are cut at the photograph's sides; masks are sampled on the grid. Things without
// a score above 0 and empty ones are left out. INVALID_ARGUMENT, with `name` and the number of the
// thing: the text is not of this format, a score is above 1, a mask has another size than the
// photograph, or there are more than kMostTextThings.
absl::StatusOr<std::vector<Sighting>> ParseTextSightings(absl::string_view text,
                                                         const std::string& name,
                                                         const SearchedPhotograph& photo);

}  // namespace pepeseg
