#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/edit_distance.h"
#include "core/base/file_name.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/import.h"

namespace pepeseg {
namespace {

// Returns the three names that are nearest to `name`, the nearest first. Of a long name, the
// beginning is compared: the time of a comparison grows with its length.
std::vector<std::string> Nearest(const std::string& name, std::span<const std::string> names) {
  constexpr size_t kNamed = 3, kLongest = 300;
  std::vector<std::pair<size_t, std::string>> ranked;
  for (const std::string& other : names) {
    // A missing suffix or folder is the usual mistake: it counts as nearer than any typing error.
    const bool part = WithoutSuffix(other) == name || absl::EndsWith(other, "/" + name);
    ranked.emplace_back(part ? 0 : 1 + EditDistance(name.substr(0, kLongest), other), other);
  }
  std::sort(ranked.begin(), ranked.end());
  std::vector<std::string> nearest;
  for (size_t i = 0; i < std::min(ranked.size(), kNamed); ++i) nearest.push_back(ranked[i].second);
  return nearest;
}

}  // namespace

absl::Status CheckHeldOutViews(const ImportOptions& options,
                               std::span<const std::string> photographs) {
  const std::set<std::string> known(photographs.begin(), photographs.end());
  std::set<std::string> held_out;
  for (const std::string& view : options.held_out_views) {
    held_out.insert(PhotoKey(view));
    if (known.contains(PhotoKey(view))) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("held_out_views: the dataset has no photograph \"", view,
                     "\"; names like it: ", absl::StrJoin(Nearest(view, photographs), ", ")));
  }
  if (!held_out.empty() && held_out.size() == known.size()) {
    return absl::InvalidArgumentError(absl::StrCat("held_out_views: all ", known.size(),
                                                   " photographs are held out of training"));
  }
  return absl::OkStatus();
}

bool IsHeldOut(const ImportOptions& options, absl::string_view view, size_t index) {
  if (!options.held_out_views.empty()) {
    return std::any_of(options.held_out_views.begin(), options.held_out_views.end(),
                       [&](const std::string& name) { return PhotoKey(name) == view; });
  }
  return options.held_out_every > 0 && index % static_cast<size_t>(options.held_out_every) == 0;
}

int64_t NumHeldOut(const ImportOptions& options, int64_t num_views) {
  if (!options.held_out_views.empty()) {
    std::set<std::string> held_out;
    for (const std::string& view : options.held_out_views) held_out.insert(PhotoKey(view));
    return std::min(num_views, static_cast<int64_t>(held_out.size()));
  }
  // Views 0, n, 2 n ...: rounded up.
  const int64_t every = options.held_out_every;
  return every > 0 ? (num_views + every - 1) / every : 0;
}

}  // namespace pepeseg
