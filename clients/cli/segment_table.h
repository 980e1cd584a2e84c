#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "clients/terminal/picture.h"
#include "clients/terminal/text_table.h"
#include "pepeseg/v1/decomposition.pb.h"

namespace pepeseg::client::cli {

// A table of all segments of a decomposition: where they are, how large, in which views, and what
// they are called.
class SegmentTable {
 public:
  explicit SegmentTable(v1::DecomposeModelResponse answer);

  // Counts the pixels of the segments of a level in a view, of which `ids` has the segments' ids.
  void CountView(int level, const Grey16Picture& ids);
  // Compares the mask of a label, 0 or 1, with the segments of a level in the label's view. Of all
  // segments that it is compared with, the one with the greatest IoU gets the label's text as its
  // name, if that is at least one half. Sizes that differ: compares nothing.
  void CompareLabel(const std::string& text, int level, const Grey16Picture& ids,
                    const std::vector<uint8_t>& mask);

  // Returns a header and a row for each segment, from the coarsest level down: level, id, parent
  // (on the next level; 0: none), name, number of Gaussians, views that show it, its pixels in all
  // views, and its box in scene units. Several names of one segment are separated by "; ".
  std::vector<TableRow> Rows() const;

 private:
  struct Segment {
    int level, id;
    auto operator<=>(const Segment&) const = default;
  };
  struct Sighting {
    int64_t num_views = 0, num_pixels = 0;
  };
  struct Match {
    Segment segment;
    double iou = 0;
  };
  std::string NamesOf(const Segment& segment) const;

  const v1::DecomposeModelResponse answer_;
  std::map<Segment, Sighting> seen_;
  std::map<std::string, Match> labels_;  // by text
};

}  // namespace pepeseg::client::cli
