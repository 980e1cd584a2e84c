#include "core/annotations/things_table.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "core/base/status_macros.h"
#include "core/formats/rle.h"

namespace pepeseg {
namespace {

// Pixels from `first` to before `last`, counted down the columns.
struct ColumnRun {
  int64_t first = 0, last = 0;
};

std::vector<ColumnRun> RunsOf(const std::vector<int64_t>& counts) {
  std::vector<ColumnRun> runs;
  int64_t at = 0;
  for (size_t i = 0; i < counts.size(); ++i) {
    if (i % 2 == 1 && counts[i] > 0) runs.push_back({at, at + counts[i]});
    at += counts[i];
  }
  return runs;
}

int64_t AreaOf(const std::vector<ColumnRun>& runs) {
  int64_t area = 0;
  for (const ColumnRun& run : runs) area += run.last - run.first;
  return area;
}

int64_t CommonOf(const std::vector<ColumnRun>& a, const std::vector<ColumnRun>& b) {
  int64_t common = 0;
  for (size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    const int64_t last = std::min(a[i].last, b[j].last);
    common += std::max<int64_t>(0, last - std::max(a[i].first, b[j].first));
    if (a[i].last == last) {
      ++i;
    } else {
      ++j;
    }
  }
  return common;
}

std::string CsvCell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  return absl::StrCat("\"", absl::StrReplaceAll(text, {{"\"", "\"\""}}), "\"");
}

}  // namespace

ThingsTable::ThingsTable(const AnnotatedScene& scene)
    : scene_(scene),
      num_views_(scene.things.size(), 0),
      num_pixels_(scene.things.size(), 0),
      overlaps_(scene.are_segments ? 0 : scene.things.size() * scene.things.size()) {}

absl::Status ThingsTable::Add(const AnnotatedView& view) {
  std::vector<std::vector<ColumnRun>> runs;
  std::vector<int64_t> areas;
  for (size_t t = 0; t < scene_.things.size(); ++t) {
    ASSIGN_OR_RETURN(const std::vector<int64_t> counts, ParseCocoCounts(view.counts[t]));
    runs.push_back(RunsOf(counts));
    areas.push_back(AreaOf(runs.back()));
    num_pixels_[t] += areas[t];
    num_views_[t] += areas[t] > 0 ? 1 : 0;
    for (size_t earlier = 0; earlier < t && !scene_.are_segments; ++earlier) {
      if (areas[earlier] == 0 || areas[t] == 0) continue;
      Overlap& overlap = overlaps_[earlier * scene_.things.size() + t];
      overlap.common += CommonOf(runs[earlier], runs[t]);
      overlap.first += areas[earlier];
      overlap.second += areas[t];
    }
  }
  return absl::OkStatus();
}

ThingsTable::Overlap ThingsTable::Of(size_t thing, size_t other) const {
  const size_t count = scene_.things.size();
  if (thing < other) return overlaps_[thing * count + other];
  const Overlap& turned = overlaps_[other * count + thing];
  return {turned.common, turned.second, turned.first};
}

std::optional<size_t> ThingsTable::ParentOf(size_t thing) const {
  std::optional<size_t> parent;
  for (size_t other = 0; other < scene_.things.size() && !overlaps_.empty(); ++other) {
    if (other == thing) continue;
    const Overlap overlap = Of(thing, other);
    const bool is_in = overlap.common > 0 && 10 * overlap.common >= 9 * overlap.first &&
                       overlap.second > overlap.first;
    if (is_in && (!parent || num_pixels_[other] < num_pixels_[*parent])) parent = other;
  }
  return parent;
}

std::string ThingsTable::Csv(const std::vector<ThingGaussians>& gaussians) const {
  std::string csv =
      "id,parent,name,category,instance_id,track_id,gaussians,views,pixels,"
      "min_x,min_y,min_z,max_x,max_y,max_z\n";
  for (size_t t = 0; t < scene_.things.size(); ++t) {
    const AnnotatedThing& thing = scene_.things[t];
    const std::optional<size_t> around = ParentOf(t);
    const std::string parent =
        gaussians[t].parent.value_or(around ? scene_.things[*around].id : "");
    std::vector<std::string> cells = {CsvCell(thing.id),
                                      CsvCell(parent),
                                      CsvCell(thing.text),
                                      CsvCell(thing.category),
                                      absl::StrCat(thing.instance),
                                      absl::StrCat(thing.track),
                                      absl::StrCat(gaussians[t].count),
                                      absl::StrCat(num_views_[t]),
                                      absl::StrCat(num_pixels_[t])};
    for (const auto& corner : {gaussians[t].min, gaussians[t].max}) {
      for (const double value : corner) {
        cells.push_back(gaussians[t].count > 0 ? absl::StrFormat("%.9g", value) : "");
      }
    }
    absl::StrAppend(&csv, absl::StrJoin(cells, ","), "\n");
  }
  return csv;
}

}  // namespace pepeseg
