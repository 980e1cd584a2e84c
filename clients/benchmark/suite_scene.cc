#include "clients/benchmark/suite_scene.h"

#include <algorithm>
#include <array>
#include <map>
#include <tuple>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "clients/benchmark/outlines.h"
#include "clients/benchmark/suite_photographs.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/nearest_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/picture.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

absl::Status Missing(const fs::path& where, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(where.string(), ": ", what));
}

// Returns the names of the PNGs in a folder, without suffix.
std::vector<std::string> PngStems(const fs::path& folder) {
  std::vector<std::string> stems;
  for (const std::string& name : SortedNames(folder)) {
    if (absl::EndsWithIgnoreCase(name, ".png")) stems.push_back(name.substr(0, name.size() - 4));
  }
  return stems;
}

// Returns the first of the folders that exists, or an error that lists them.
absl::StatusOr<fs::path> FirstFolder(const std::vector<fs::path>& folders, absl::string_view what) {
  for (const fs::path& folder : folders) {
    if (IsFolder(folder)) return folder;
  }
  std::vector<std::string> names;
  for (const fs::path& folder : folders) names.push_back(folder.string());
  return absl::InvalidArgumentError(
      absl::StrCat("no ", what, ": looked for the folders ", absl::StrJoin(names, ", ")));
}

// Returns the view that `stem` names, or an error that names the file.
absl::StatusOr<std::string> ViewFor(const BenchmarkScene& scene, absl::string_view stem,
                                    const fs::path& file) {
  const std::vector<std::string> views = ViewsOf(scene.dataset);
  if (const auto view = ViewOfStem(views, stem)) return *view;
  return Missing(file, absl::StrCat("no photograph \"", stem, "\" among the ", views.size(), " of ",
                                    scene.folder.string(), DidYouMean(NearestNames(stem, views))));
}

// Returns true if the mask has a pixel that is not 0.
absl::StatusOr<bool> ShowsAnything(const fs::path& mask) {
  ASSIGN_OR_RETURN(const GreyPicture picture, ReadGreyPicture(mask));
  return std::any_of(picture.pixels.begin(), picture.pixels.end(),
                     [](uint8_t pixel) { return pixel != 0; });
}

// Adds, for each entity, its own mask in the first view that shows it.
absl::Status PromptByOwnMasks(BenchmarkScene& scene) {
  std::map<std::string, std::string> reference;  // view by entity
  for (const TruthFile& file : scene.truth) {
    if (reference.contains(file.entity)) continue;
    ASSIGN_OR_RETURN(const bool shows, ShowsAnything(file.mask));
    if (shows) reference[file.entity] = file.view;
  }
  for (const auto& [entity, view] : reference) scene.prompts.push_back({entity, view, {}, {}, {}});
  if (!scene.prompts.empty()) return absl::OkStatus();
  return Missing(scene.folder, "all masks are empty");
}

// NVOS: one reference view, one target view.

absl::Status ReadNvosReference(const fs::path& folder, BenchmarkScene& scene) {
  const fs::path references = folder / "reference_image" / scene.name;
  const std::vector<std::string> images = SortedNames(references);
  if (images.size() != 1) {
    return Missing(references,
                   absl::StrCat("looked for one image, the reference view; found ", images.size()));
  }
  ReferencePrompt prompt{scene.name, "", {}, {}, {}};
  ASSIGN_OR_RETURN(prompt.view,
                   ViewFor(scene, fs::path(images[0]).stem().string(), references / images[0]));
  const fs::path scribbles = folder / "scribbles" / scene.name;
  std::vector<fs::path> others;
  for (const std::string& stem : PngStems(scribbles)) {
    const fs::path file = scribbles / (stem + ".png");
    auto& files = absl::StartsWith(stem, "pos_")   ? prompt.positive
                  : absl::StartsWith(stem, "neg_") ? prompt.negative
                                                   : others;
    files.push_back(file);
  }
  if (prompt.positive.empty() && others.size() == 1) prompt.mask = others[0];
  if (prompt.positive.empty() && prompt.mask.empty()) {
    return Missing(scribbles,
                   "looked for pos_*.png and neg_*.png, or for one other PNG, the reference mask");
  }
  scene.prompts = {std::move(prompt)};
  return absl::OkStatus();
}

absl::StatusOr<BenchmarkScene> ReadNvosScene(const fs::path& folder, const std::string& name,
                                             const SceneSearch& search) {
  BenchmarkScene scene;
  scene.name = name;
  std::vector<fs::path> places;
  // horns_left and horns_center are two targets of the scene horns.
  for (const std::string& place : {name, name.substr(0, name.rfind('_'))}) {
    for (const char* above : {"", "scenes", "nerf_llff_data"}) {
      places.push_back(folder / above / place);
    }
  }
  ASSIGN_OR_RETURN(scene.folder, FirstFolder(places, "LLFF scene of " + name));
  ASSIGN_OR_RETURN(scene.dataset, ReadLlffScene(scene.folder, search.images));
  RETURN_IF_ERROR(ReadNvosReference(folder, scene));
  const fs::path masks = folder / "masks" / name;
  const std::vector<std::string> stems = PngStems(masks);
  if (stems.size() != 1 || !absl::EndsWith(stems[0], "_mask")) {
    return Missing(masks, absl::StrCat("looked for one file TARGET_mask.png, found ",
                                       stems.empty() ? "none" : absl::StrJoin(stems, ", ")));
  }
  const fs::path mask = masks / (stems[0] + ".png");
  ASSIGN_OR_RETURN(const std::string target,
                   ViewFor(scene, stems[0].substr(0, stems[0].size() - 5), mask));
  scene.truth = {{name, target, mask}};
  // Every 8th view as for all LLFF scenes, and the target, which must not be trained on.
  scene.held_out_views = HeldOutViews(scene);
  const auto& out = scene.held_out_views;
  if (std::find(out.begin(), out.end(), target) == out.end()) {
    scene.held_out_views.push_back(target);
  }
  return scene;
}

// SPIn-NeRF: a mask of one object in each annotated view.

std::vector<fs::path> SpinMaskFolders(const fs::path& folder, const std::string& name) {
  return {folder / name / "object_masks", folder / "scenes" / name / "object_masks",
          folder / "masks" / name};
}

absl::StatusOr<BenchmarkScene> ReadSpinScene(const fs::path& folder, const std::string& name,
                                             const SceneSearch& search) {
  BenchmarkScene scene;
  scene.name = name;
  ASSIGN_OR_RETURN(scene.folder,
                   FirstFolder({folder / name, folder / "scenes" / name}, "LLFF scene of " + name));
  ASSIGN_OR_RETURN(scene.dataset, ReadLlffScene(scene.folder, search.images));
  ASSIGN_OR_RETURN(const fs::path masks,
                   FirstFolder(SpinMaskFolders(folder, name), "object masks of " + name));
  for (const std::string& stem : PngStems(masks)) {
    const fs::path mask = masks / (stem + ".png");
    ASSIGN_OR_RETURN(const std::string view, ViewFor(scene, stem, mask));
    scene.truth.push_back({name, view, mask});
  }
  if (scene.truth.size() < 2) {
    return Missing(masks, absl::StrCat("looked for the object's masks of 2 or more views, *.png; "
                                       "found ",
                                       scene.truth.size()));
  }
  std::sort(scene.truth.begin(), scene.truth.end(),
            [](const TruthFile& a, const TruthFile& b) { return a.view < b.view; });
  RETURN_IF_ERROR(PromptByOwnMasks(scene));
  return scene;
}

// LERF-Mask: masks by text prompts in test views.

absl::StatusOr<BenchmarkScene> ReadLerfScene(const fs::path& folder, const std::string& name,
                                             const SceneSearch& /*search*/) {
  BenchmarkScene scene;
  scene.name = name;
  scene.folder = folder / name;
  ASSIGN_OR_RETURN(scene.dataset, ReadDatasetFolder(scene.folder));
  const fs::path tests = scene.folder / "test_mask";
  for (const std::string& test : SortedNames(tests)) {
    if (!IsFolder(tests / test)) continue;
    ASSIGN_OR_RETURN(const std::string view, ViewFor(scene, test, tests / test));
    for (const std::string& prompt : PngStems(tests / test)) {
      scene.truth.push_back({prompt, view, tests / test / (prompt + ".png")});
    }
    scene.held_out_views.push_back(view);
  }
  if (scene.truth.empty()) {
    return Missing(tests, "looked for VIEW/PROMPT.png, the masks of the test views; found none");
  }
  std::sort(scene.truth.begin(), scene.truth.end(), [](const TruthFile& a, const TruthFile& b) {
    return std::tie(a.entity, a.view) < std::tie(b.entity, b.view);
  });
  RETURN_IF_ERROR(PromptByOwnMasks(scene));
  return scene;
}

// Our own scenes.

// Checks that outlines are of photographs of the scene, and holds views with outlines out of
// training: those, if they are at most a quarter of all, otherwise every 8th. INVALID_ARGUMENT: no
// held-out view has outlines.
absl::Status HoldOutOutlinedViews(const TruthLevel& level, BenchmarkScene& scene) {
  const std::vector<std::string> views = ViewsOf(scene.dataset);
  if (views.empty()) return absl::OkStatus();  // frames of videos have no names yet
  if (const auto unknown = PhotographsNotIn(views, level.outlines); !unknown.empty()) {
    const OutlinedPhotograph& first = *unknown.front();
    return Missing(first.file, absl::StrCat("no photograph \"", first.name, "\" among the ",
                                            views.size(), " of ", scene.folder.string(),
                                            DidYouMean(NearestNames(first.name, views))));
  }
  std::vector<std::string> outlined = views;
  std::erase_if(outlined, [&](const std::string& view) {
    return OutlinesOf(level.outlines, view) == nullptr;
  });
  if (4 * outlined.size() <= views.size()) scene.held_out_views = outlined;
  const std::vector<std::string> held_out = HeldOutViews(scene);
  const bool scored = std::any_of(held_out.begin(), held_out.end(), [&](const std::string& view) {
    return OutlinesOf(level.outlines, view) != nullptr;
  });
  if (scored) return absl::OkStatus();
  return Missing(level.folder,
                 absl::StrCat("outlines of ", outlined.size(), " photographs, but of none that is ",
                              "held out: ", absl::StrJoin(held_out, ", "),
                              "; outline these, or at most a quarter of the ", views.size()));
}

absl::StatusOr<BenchmarkScene> ReadOwnScene(const fs::path& folder, const std::string& name,
                                            const SceneSearch& /*search*/) {
  BenchmarkScene scene;
  scene.folder = name.empty() ? folder : folder / name;
  scene.name = fs::absolute(scene.folder).lexically_normal().filename().string();
  ASSIGN_OR_RETURN(scene.dataset, ReadDatasetFolder(scene.folder));
  ASSIGN_OR_RETURN(scene.levels, FindTruth(scene.folder));
  if (scene.levels.empty() && !Has(scene.dataset, v1::FILE_KIND_MASK)) {
    return Missing(
        scene.folder,
        "nothing to score against: looked for labels/, gt/labels.json, annotations.json, "
        "annotations/ and masks/ in it");
  }
  for (const TruthLevel& level : scene.levels) {
    if (!level.outlines.empty()) RETURN_IF_ERROR(HoldOutOutlinedViews(level, scene));
  }
  return scene;
}

// A layout: how its scenes are found and read.
struct Layout {
  const char* name;
  const char* marks;  // what a scene is recognised by, for errors
  std::vector<std::string> (*list)(const fs::path& folder);
  absl::StatusOr<BenchmarkScene> (*read)(const fs::path& folder, const std::string& name,
                                         const SceneSearch& search);
};

std::vector<std::string> NvosScenes(const fs::path& folder) {
  return SortedNames(folder / "masks");
}

std::vector<std::string> SpinScenes(const fs::path& folder) {
  std::vector<std::string> names;
  for (const fs::path& above : {folder, folder / "scenes"}) {
    for (const std::string& name : SortedNames(above)) {
      const std::vector<fs::path> masks = SpinMaskFolders(folder, name);
      if (std::any_of(masks.begin(), masks.end(), IsFolder)) names.push_back(name);
    }
  }
  return names;
}

std::vector<std::string> LerfScenes(const fs::path& folder) {
  std::vector<std::string> names = SortedNames(folder);
  std::erase_if(names, [&](const std::string& n) { return !IsFolder(folder / n / "test_mask"); });
  return names;
}

std::vector<std::string> OwnScenes(const fs::path& folder) {
  if (IsFolder(folder / "images")) return {""};
  std::vector<std::string> names = SortedNames(folder);
  std::erase_if(names, [&](const std::string& n) { return !IsFolder(folder / n / "images"); });
  return names;
}

// In the order of Benchmark.
const std::array<Layout, 5>& Layouts() {
  static const std::array<Layout, 5> layouts = {{
      {"nvos", "masks/SCENE/TARGET_mask.png", NvosScenes, ReadNvosScene},
      {"spin-nerf", "SCENE/object_masks/ or masks/SCENE/, for a folder SCENE/ or scenes/SCENE/",
       SpinScenes, ReadSpinScene},
      {"lerf-mask", "SCENE/test_mask/VIEW/PROMPT.png", LerfScenes, ReadLerfScene},
      {"lerf-mask-fine", "SCENE/test_mask/VIEW/PROMPT.png", LerfScenes, ReadLerfScene},
      {"scene", "images/, or SCENE/images/", OwnScenes, ReadOwnScene},
  }};
  return layouts;
}

}  // namespace

const std::vector<std::string>& BenchmarkNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Layout& layout : Layouts()) all.emplace_back(layout.name);
    return all;
  }();
  return names;
}

Benchmark BenchmarkOf(absl::string_view name) {
  const auto& names = BenchmarkNames();
  return static_cast<Benchmark>(std::find(names.begin(), names.end(), name) - names.begin());
}

std::string NameOf(Benchmark benchmark) { return BenchmarkNames()[static_cast<size_t>(benchmark)]; }

std::vector<std::string> HeldOutViews(const BenchmarkScene& scene) {
  if (!scene.held_out_views.empty()) return scene.held_out_views;
  const std::vector<std::string> views = ViewsOf(scene.dataset);
  std::vector<std::string> held_out;
  for (size_t i = 0; i < views.size(); i += 8) held_out.push_back(views[i]);
  return held_out;
}

absl::StatusOr<std::vector<BenchmarkScene>> FindScenes(Benchmark benchmark, const fs::path& folder,
                                                       const SceneSearch& search) {
  if (!IsFolder(folder)) return LocalFileMissing("no such folder: " + folder.string());
  const Layout& layout = Layouts()[static_cast<size_t>(benchmark)];
  const std::vector<std::string> found = layout.list(folder);
  if (found.empty()) {
    return Missing(folder, absl::StrCat("not the layout of ", layout.name, ": looked for ",
                                        layout.marks, " in it"));
  }
  for (const std::string& name : search.scenes) {
    if (std::find(found.begin(), found.end(), name) != found.end()) continue;
    return Missing(folder,
                   absl::StrCat("no scene \"", name, "\"; it has ", absl::StrJoin(found, ", ")));
  }
  std::vector<BenchmarkScene> scenes;
  for (const std::string& name : search.scenes.empty() ? found : search.scenes) {
    ASSIGN_OR_RETURN(BenchmarkScene scene, layout.read(folder, name, search));
    scenes.push_back(std::move(scene));
  }
  return scenes;
}

}  // namespace pepeseg::client::cli
