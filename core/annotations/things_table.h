#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/annotations/things.h"

namespace pepeseg {

// The Gaussians of a thing in 3D.
struct ThingGaussians {
  int64_t count = 0;
  // Lowest and highest corner of the box of their means, scene units. Not used without Gaussians.
  std::array<double, 3> min = {}, max = {};
  // Id of what the thing is a part of. Absent: what the masks say.
  std::optional<std::string> parent = std::nullopt;
};

// A table of all things: where they are, how large, in which views, and what they are parts of.
class ThingsTable {
 public:
  // The scene must outlive the table.
  explicit ThingsTable(const AnnotatedScene& scene);

  // Counts the masks of a view. INVALID_ARGUMENT: a mask is malformed.
  absl::Status Add(const AnnotatedView& view);

  // Returns the smallest thing that has nine tenths of a thing's pixels, in views that show both,
  // and is larger there; nullopt: there is none, or the things are segments.
  std::optional<size_t> ParentOf(size_t thing) const;

  // Returns a header and a line for each thing as CSV. `gaussians` has each thing's.
  std::string Csv(const std::vector<ThingGaussians>& gaussians) const;

 private:
  // Two things in views that show both.
  struct Overlap {
    int64_t common = 0, first = 0, second = 0;  // pixels
  };
  // Returns the overlap of a thing with another; `first` is of `thing`.
  Overlap Of(size_t thing, size_t other) const;

  const AnnotatedScene& scene_;
  std::vector<int64_t> num_views_, num_pixels_;
  std::vector<Overlap> overlaps_;  // [thing][other], other > thing; empty: segments
};

}  // namespace pepeseg
