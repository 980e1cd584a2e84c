#include "clients/benchmark/suite_variants.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "clients/benchmark/suite_photographs.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using OptionSettings = std::vector<std::string>;

OptionSettings Joined(OptionSettings settings, const OptionSettings& more) {
  settings.insert(settings.end(), more.begin(), more.end());
  return settings;
}

// Returns the photographs to upload: the held-out ones, and every fourth of the others.
std::set<std::string> QuarterOf(const BenchmarkScene& scene) {
  const std::vector<std::string> names = HeldOutViews(scene);
  const std::set<std::string> held_out(names.begin(), names.end());
  std::set<std::string> kept;
  size_t trained = 0;
  for (const std::string& view : ViewsOf(scene.dataset)) {
    if (held_out.contains(view) || trained++ % 4 == 0) kept.insert("images/" + view);
  }
  return kept;
}

// True for the masks that are left out: those with index 1, 4 and 7 modulo 10.
bool IsLeftOut(size_t index) { return index % 10 % 3 == 1; }

// Writes SAM's masks without those that are left out, and returns the new file.
absl::StatusOr<fs::path> Thinned(const FolderFile& file, const fs::path& folder) {
  ASSIGN_OR_RETURN(const std::string text, ReadFile(file.path));
  const auto json = nlohmann::ordered_json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_array()) {
    return absl::InvalidArgumentError(file.path.string() + ": expected SAM's list of masks");
  }
  auto kept = nlohmann::ordered_json::array();
  for (size_t i = 0; i < json.size(); ++i) {
    if (!IsLeftOut(i)) kept.push_back(json[i]);
  }
  RETURN_IF_ERROR(WriteFile(folder / file.name, kept.dump()));
  return folder / file.name;
}

// Leaves out 30 % of the masks.
absl::Status ThinOut(const std::string& scene, const fs::path& folder, DatasetFolder& dataset) {
  std::vector<FolderFile> kept;
  std::string above;  // folder of PNGs that `index` counts in
  size_t index = 0;
  bool any = false;
  for (FolderFile& file : dataset.files) {
    const bool in_folder = std::count(file.name.begin(), file.name.end(), '/') > 1;
    if (file.kind == v1::FILE_KIND_MASK && absl::EndsWith(file.name, ".json")) {
      ASSIGN_OR_RETURN(file.path, Thinned(file, folder));
      any = true;
    } else if (file.kind == v1::FILE_KIND_MASK && in_folder && absl::EndsWith(file.name, ".png")) {
      const std::string parent = file.name.substr(0, file.name.rfind('/'));
      if (std::exchange(above, parent) != parent) index = 0;
      any = true;
      if (IsLeftOut(index++)) continue;
    }
    kept.push_back(std::move(file));
  }
  dataset.files = std::move(kept);
  if (any) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(scene,
                   ": fewer masks need masks to leave out: looked for masks/STEM.json and "
                   "masks/STEM/NAME.png"));
}

}  // namespace

std::vector<BenchmarkVariant> AblationVariants() {
  const OptionSettings no_refinement = {"reconstruct.refine_keep=none"};
  const OptionSettings refinement = {"reconstruct.refine_keep=shrink"};
  const OptionSettings no_depth = {"reconstruct.depth_weight=0",
                                   "reconstruct.depth_weight_final=0"};
  const OptionSettings depth = {"reconstruct.depth_weight=-1"};
  const OptionSettings no_perception = {"features.perception_weight=0"};
  const OptionSettings no_centroids = {"features.centroid_weight_upper=0",
                                       "features.centroid_weight_lower=0"};
  const OptionSettings masks_only = Joined(no_perception, no_centroids);
  const OptionSettings both_priors = Joined(refinement, depth);
  std::vector<BenchmarkVariant> variants = {
      {"masks only, plain reconstruction", Joined(Joined(no_refinement, no_depth), masks_only),
       "25.86 dB; 78.4 (SAGA)"},
      {"+ refinement", Joined(Joined(refinement, no_depth), masks_only), "26.32 dB"},
      {"+ depth", Joined(both_priors, masks_only), "27.08 dB; 79.2"},
      {"+ perception loss", Joined(both_priors, no_centroids), "80.2"},
      {"+ centroid loss: all", both_priors, "80.5"},
  };
  for (const int k : {2, 8, 16, 32}) {
    variants.push_back({absl::StrCat("k = ", k),
                        {absl::StrCat("features.num_neighbors=", k),
                         absl::StrCat("features.num_drawn_neighbors=", k)},
                        ""});
  }
  for (const char* tau : {"0.8", "0.85", "0.95"}) {
    variants.push_back({absl::StrCat("tau = ", tau),
                        {absl::StrCat("features.centroid_cosine_upper=", tau),
                         absl::StrCat("features.centroid_cosine_lower=", tau),
                         absl::StrCat("features.centroid_merge_upper=", tau),
                         absl::StrCat("features.centroid_merge_lower=", tau)},
                        ""});
  }
  for (const int t : {50, 100, 400, 800}) {
    variants.push_back(
        {absl::StrCat("T = ", t), {absl::StrCat("features.centroid_every=", t)}, ""});
  }
  return variants;
}

std::vector<BenchmarkVariant> RobustnessVariants() {
  return {{"all views and masks", {}, "80.5 / 76.5"},
          {"a quarter of the views", {}, "62.9 / 59.6 (SAGA 60.5 / 58.5)", true, false},
          {"30 % fewer masks", {}, "67.1 / 65.5 by SAM 2 (SAGA 64.6 / 62.5)", false, true}};
}

absl::StatusOr<DatasetFolder> DatasetOf(const BenchmarkVariant& variant,
                                        const BenchmarkScene& scene, const fs::path& folder) {
  DatasetFolder dataset = scene.dataset;
  if (variant.quarter_of_views) {
    const std::set<std::string> kept = QuarterOf(scene);
    std::erase_if(dataset.files, [&](const FolderFile& file) {
      return file.kind == v1::FILE_KIND_IMAGE && !kept.contains(file.name);
    });
  }
  if (variant.fewer_masks) RETURN_IF_ERROR(ThinOut(scene.name, folder / scene.name, dataset));
  return dataset;
}

}  // namespace pepeseg::client::cli
