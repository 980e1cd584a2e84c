#include "clients/cli/segment_tree.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace pepeseg::client::cli {
namespace {

using Response = v1::DecomposeResponse;

double Extent(const Response::Segment& segment, int axis) {
  if (axis >= segment.min_size() || axis >= segment.max_size()) return 0;
  return segment.max(axis) - segment.min(axis);
}

void AddSegmentsOf(const Response& answer, int level, int parent, std::vector<std::string>& lines) {
  const std::string indent(static_cast<size_t>(2 * (answer.levels_size() - level)), ' ');
  for (const Response::Segment& segment : answer.levels(level).segments()) {
    if (segment.parent() != parent) continue;
    const std::string name = absl::StrCat(indent, level, ":", segment.id());
    lines.push_back(absl::StrFormat("%-16s %9d Gaussians  %.3g x %.3g x %.3g scene units", name,
                                    segment.num_gaussians(), Extent(segment, 0), Extent(segment, 1),
                                    Extent(segment, 2)));
    if (level > 0) AddSegmentsOf(answer, level - 1, segment.id(), lines);
  }
}

}  // namespace

std::vector<std::string> SegmentTree(const Response& answer) {
  std::vector<std::string> lines = {answer.model()};
  lines.reserve(static_cast<size_t>(answer.levels_size()) + 1);
  for (int i = 0; i < answer.levels_size(); ++i) {
    const Response::Level& level = answer.levels(i);
    lines.push_back(absl::StrFormat(
        "level %d  scale %.3g (%.4g scene units)  %d segments  %d Gaussians in none", i,
        level.scale_quantile(), level.scale_units(), level.segments_size(),
        level.num_unassigned()));
  }
  if (answer.levels_size() > 0) AddSegmentsOf(answer, answer.levels_size() - 1, 0, lines);
  return lines;
}

}  // namespace pepeseg::client::cli
