#include "clients/cli/segment_table.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace pepeseg::client::cli {
namespace {

// Returns the number of pixels of each id but 0.
std::map<int, int64_t> CountIds(const Grey16Picture& ids) {
  std::map<int, int64_t> counts;
  for (const uint16_t id : ids.pixels) {
    if (id != 0) ++counts[id];
  }
  return counts;
}

}  // namespace

SegmentTable::SegmentTable(v1::DecomposeModelResponse answer) : answer_(std::move(answer)) {}

void SegmentTable::CountView(int level, const Grey16Picture& ids) {
  for (const auto& [id, count] : CountIds(ids)) {
    Sighting& sighting = seen_[{level, id}];
    ++sighting.num_views;
    sighting.num_pixels += count;
  }
}

void SegmentTable::CompareLabel(const std::string& text, int level, const Grey16Picture& ids,
                                const std::vector<uint8_t>& mask) {
  if (mask.size() != ids.pixels.size()) return;
  int64_t area = 0;
  std::map<int, int64_t> common;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] == 0) continue;
    ++area;
    if (ids.pixels[i] != 0) ++common[ids.pixels[i]];
  }
  const std::map<int, int64_t> counts = CountIds(ids);
  Match& best = labels_[text];
  for (const auto& [id, inside] : common) {
    const double iou =
        static_cast<double>(inside) / static_cast<double>(area + counts.at(id) - inside);
    if (iou > best.iou) best = {{level, id}, iou};
  }
}

std::string SegmentTable::NamesOf(const Segment& segment) const {
  constexpr double kLeastIou = 0.5;
  std::vector<std::string> names;
  for (const auto& [text, match] : labels_) {
    if (match.iou >= kLeastIou && match.segment == segment) names.push_back(text);
  }
  return absl::StrJoin(names, "; ");
}

std::vector<TableRow> SegmentTable::Rows() const {
  std::vector<TableRow> rows = {{"level", "id", "parent", "name", "gaussians", "views", "pixels",
                                 "min_x", "min_y", "min_z", "max_x", "max_y", "max_z"}};
  for (int level = answer_.levels_size(); level-- > 0;) {
    for (const auto& segment : answer_.levels(level).segments()) {
      const auto found = seen_.find({level, segment.id()});
      const Sighting sighting = found == seen_.end() ? Sighting() : found->second;
      TableRow row = {absl::StrCat(level),
                      absl::StrCat(segment.id()),
                      absl::StrCat(segment.parent()),
                      NamesOf({level, segment.id()}),
                      absl::StrCat(segment.num_gaussians()),
                      absl::StrCat(sighting.num_views),
                      absl::StrCat(sighting.num_pixels)};
      for (const v1::Vector3& corner : {segment.box().min(), segment.box().max()}) {
        for (const double value : {corner.x(), corner.y(), corner.z()}) {
          row.push_back(absl::StrFormat("%.9g", value));
        }
      }
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

}  // namespace pepeseg::client::cli
