#include "clients/benchmark/evaluation_truth.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "clients/benchmark/outline_files.h"
#include "clients/benchmark/scene_truth.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/nearest_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/picture.h"
#include "clients/terminal/view_picture.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

// Returns FOLDER/STEM with an ending.
fs::path FileOf(const fs::path& folder, const std::string& view, const std::string& ending) {
  return folder / fs::path(view).replace_extension(ending);
}

bool IsFile(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

// Returns the PNG files of a folder, sorted by name. Empty if the folder does not exist.
std::vector<fs::path> PngsOf(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".png") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

// Returns "; did you mean ...?" with the views whose names are like a name, "" if there are none.
std::string DidYouMeanView(const std::string& name, const std::vector<v1::View>& views) {
  std::map<std::string, std::string> view_of;  // by stem: all names may have the same ending
  std::vector<std::string> stems;
  for (const v1::View& view : views) {
    view_of[stems.emplace_back(FileOf("", view.view(), "").string())] = view.view();
  }
  std::vector<std::string> near = NearestNames(FileOf("", name, "").string(), stems);
  for (std::string& stem : near) stem = view_of[stem];
  return DidYouMean(near);
}

// Returns the size of a view in the pixels of a frame.
PixelSize SizeIn(v1::PixelFrame frame, const v1::View& view) {
  if (frame != v1::PIXEL_FRAME_VIEW) return PhotographSize(view);
  return {view.camera().width(), view.camera().height()};
}

// Adds the label image and the masks that a view has in a folder. `fitting`: the label image is
// resampled to the photograph.
absl::Status AddImages(const fs::path& folder, const v1::View& view, bool fitting,
                       v1::ViewTruth& truth) {
  const fs::path labels = FileOf(folder, truth.view(), ".png");
  if (IsFile(labels)) {
    ASSIGN_OR_RETURN(*truth.mutable_labels_png(),
                     fitting ? LabelsPng(labels, PhotographSize(view)) : ReadFile(labels));
  }
  for (const fs::path& file : PngsOf(FileOf(folder, truth.view(), ""))) {
    v1::EntityMask& mask = *truth.add_masks();
    mask.set_entity(file.stem().string());
    ASSIGN_OR_RETURN(*mask.mutable_mask()->mutable_png(), ReadFile(file));
  }
  return absl::OkStatus();
}

// Adds the outlines of a view, in the pixels of a frame. A trained view has another lens than its
// photograph, so that only its own size shows that it was drawn on.
absl::Status AddOutlinesIn(v1::PixelFrame frame, const OutlinedPhotograph& outlines,
                           const v1::View& view, v1::ViewTruth& truth) {
  const PixelSize size = SizeIn(frame, view), drawn_on = outlines.size;
  if (frame != v1::PIXEL_FRAME_VIEW || drawn_on == size) return AddOutlines(outlines, size, truth);
  return absl::InvalidArgumentError(absl::StrCat(
      outlines.file.string(), ": outlines of \"", outlines.name, "\" on ", drawn_on.width, "x",
      drawn_on.height, " pixels; the view that was trained on has ", size.width, "x", size.height,
      ": leave out --frame view"));
}

// Adds the views that have truth of a level. Returns the names of the others.
absl::StatusOr<std::vector<std::string>> AddLevel(const TruthFlags& flags, const TruthLevel& level,
                                                  const std::vector<v1::View>& views,
                                                  v1::EvaluateModelRequest& request) {
  std::vector<std::string> without;
  for (const v1::View& view : views) {
    v1::ViewTruth truth;
    truth.set_view(view.view());
    const OutlinedPhotograph* outlines = OutlinesOf(level.outlines, view.view());
    if (outlines != nullptr) {
      RETURN_IF_ERROR(AddOutlinesIn(request.frame(), *outlines, view, truth));
    } else if (level.outlines.empty()) {
      RETURN_IF_ERROR(AddImages(level.folder, view, flags.fitting, truth));
    }
    if (truth.labels_png().empty() && truth.masks().empty()) {
      without.push_back(view.view());
      continue;
    }
    ASSIGN_OR_RETURN(*truth.mutable_ignore_png(),
                     flags.fitting && !flags.ignore.empty()
                         ? LabelsPng(flags.ignore, PhotographSize(view))
                         : IgnorePng(flags, view.view()));
    *request.add_views() = std::move(truth);
  }
  return without;
}

// Returns what was looked for, for NothingThere.
std::string WantedTruth(const AddedTruth& added) {
  const std::string first = added.views_without.empty() ? "" : added.views_without.front();
  if (!added.outlines.empty()) {
    return absl::StrCat("outlines of ", first, "; found those of ", added.outlines.size(),
                        " other photographs, such as \"", added.outlines.front().name, "\"");
  }
  const std::string stem = FileOf("", first, "").string();
  return absl::StrCat(FileOf("", first, ".png").string(), " or masks in ", stem,
                      "/, or outlines: ", stem, ".json of LabelMe, or COCO's JSON");
}

// Returns the error of a folder in which no view has what is `wanted` for it.
absl::Status NothingThere(const TruthFlags& flags, const std::vector<v1::View>& views,
                          const std::string& wanted) {
  const std::string reason = views.empty() ? "the model has no held-out view; see --trained-views"
                                           : absl::StrCat("expected ", wanted);
  return LocalFileMissing(
      absl::StrCat(flags.folder.string(), " has nothing of a view to score: ", reason));
}

absl::StatusOr<v1::SamViewMasks> SamMasksFromJson(const fs::path& file) {
  const auto bad = [&](const std::string& what) {
    return absl::InvalidArgumentError(absl::StrCat(file.string(), ": ", what));
  };
  ASSIGN_OR_RETURN(const std::string text, ReadFile(file));
  auto json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (json.is_object() && json.contains("annotations")) json = nlohmann::json(json["annotations"]);
  if (!json.is_array())
    return bad("expected a JSON array of SAM's masks, or {\"annotations\": []}");
  v1::SamViewMasks masks;
  for (const auto& entry : json) {
    const auto rle = entry.is_object() ? entry.value("segmentation", nlohmann::json()) : entry;
    const std::optional<v1::CocoRle> runs = RleOf(rle);
    if (!runs) {
      return bad(absl::StrCat("mask ", masks.masks_size(),
                              " has no segmentation {\"size\": [height, width], \"counts\": "
                              "run lengths, or COCO's compressed string}"));
    }
    v1::SamViewMasks::SamMask& mask = *masks.add_masks();
    *mask.mutable_mask()->mutable_rle() = *runs;
    const auto number = [&](const char* name) { return entry.value(name, nlohmann::json()); };
    if (number("predicted_iou").is_number())
      mask.set_predicted_iou(number("predicted_iou").get<double>());
    if (number("stability_score").is_number())
      mask.set_stability(number("stability_score").get<double>());
  }
  return masks;
}

// Reads SAM's masks of a view; none if it has no file.
absl::StatusOr<v1::SamViewMasks> ReadSamMasks(const TruthFlags& flags, const std::string& view) {
  const fs::path json = FileOf(flags.folder, view, ".json");
  if (IsFile(json)) return SamMasksFromJson(json);
  v1::SamViewMasks masks;
  for (const fs::path& file : PngsOf(FileOf(flags.folder, view, ""))) {
    ASSIGN_OR_RETURN(*masks.add_masks()->mutable_mask()->mutable_png(), ReadFile(file));
  }
  return masks;
}

// Returns the id of the void pixels of a label image as the server finds it, see
// EvaluateModelRequest.ignore_label, or 0 if there is none. ids: of the image, without 0.
int VoidIdOf(const v1::EvaluateModelRequest& request, const std::set<int>& ids) {
  constexpr int kVoidId = 255;
  if (request.has_ignore_label()) return request.ignore_label();
  const bool is_void = ids.size() > 1 && *ids.rbegin() == kVoidId;
  return is_void && !request.entity_names().contains(kVoidId) ? kVoidId : 0;
}

}  // namespace

absl::StatusOr<std::vector<v1::View>> ViewsToScore(const TruthFlags& flags,
                                                   const std::vector<v1::View>& views) {
  std::vector<v1::View> chosen;
  for (const v1::View& view : views) {
    if (flags.views.empty() && (view.held_out() || flags.trained_views)) chosen.push_back(view);
  }
  for (const std::string& name : flags.views) {
    const auto found = std::find_if(views.begin(), views.end(), [&](const v1::View& view) {
      return view.view() == name || fs::path(view.view()).replace_extension("") == name;
    });
    if (found == views.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the model has no view \"", name, "\"", DidYouMeanView(name, views)));
    }
    if (!found->held_out() && !flags.trained_views) {
      return absl::InvalidArgumentError(
          absl::StrCat("view \"", name, "\" was trained on; give --trained-views if the protocol ",
                       "scores such views"));
    }
    chosen.push_back(*found);
  }
  return chosen;
}

absl::StatusOr<std::string> IgnorePng(const TruthFlags& flags, const std::string& view) {
  if (flags.ignore.empty()) return std::string();
  std::error_code error;
  if (!fs::is_directory(flags.ignore, error)) return ReadFile(flags.ignore);
  const fs::path file = FileOf(flags.ignore, view, ".png");
  return IsFile(file) ? ReadFile(file) : std::string();
}

absl::StatusOr<AddedTruth> AddTruth(const TruthFlags& flags, const std::vector<v1::View>& views,
                                    v1::EvaluateModelRequest& request) {
  AddedTruth added;
  const TruthLevel images{"", flags.folder, {}};
  ASSIGN_OR_RETURN(added.views_without, AddLevel(flags, images, views, request));
  if (added.views_without.size() < views.size()) return added;
  ASSIGN_OR_RETURN(std::vector<TruthLevel> levels, FindTruthAt(flags.folder));
  if (levels.size() > 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(flags.folder.string(), ": gt/labels.json has ", levels.size(),
                     " levels; give the folder of one, such as ", levels.front().folder.string()));
  }
  if (!levels.empty()) {
    TruthLevel& level = levels.front();
    request.mutable_entity_names()->insert(level.entities.begin(), level.entities.end());
    ASSIGN_OR_RETURN(added.views_without, AddLevel(flags, level, views, request));
    added.outlines = std::move(level.outlines);
  }
  if (added.views_without.size() < views.size()) return added;
  return NothingThere(flags, views, WantedTruth(added));
}

absl::StatusOr<v1::EvaluateModelRequest> EvaluateRequestOf(const fs::path& dataset,
                                                           const TruthLevel& level,
                                                           const std::string& model,
                                                           const std::vector<v1::View>& views) {
  v1::EvaluateModelRequest request;
  request.set_model(model);
  request.set_frame(v1::PIXEL_FRAME_PHOTOGRAPH);
  request.mutable_entity_names()->insert(level.entities.begin(), level.entities.end());
  TruthFlags flags;
  flags.fitting = true;
  if (PathExists(dataset / "ignore_mask.png")) flags.ignore = dataset / "ignore_mask.png";
  std::vector<v1::View> held_out;
  std::copy_if(views.begin(), views.end(), std::back_inserter(held_out),
               [](const v1::View& view) { return view.held_out(); });
  RETURN_IF_ERROR(AddLevel(flags, level, held_out, request).status());
  return request;
}

std::string UnknownPhotographs(const std::vector<OutlinedPhotograph>& outlines,
                               const std::vector<v1::View>& views) {
  std::vector<std::string> names;
  names.reserve(views.size());
  for (const v1::View& view : views) names.push_back(view.view());
  const auto unknown = PhotographsNotIn(names, outlines);
  if (unknown.empty()) return "";
  const OutlinedPhotograph& first = *unknown.front();
  return absl::StrCat(unknown.size(), " of ", outlines.size(),
                      " photographs with outlines are not views of the model, such as \"",
                      first.name, "\" of ", first.file.string(), DidYouMeanView(first.name, views));
}

absl::StatusOr<std::vector<std::string>> AddSamMasks(const TruthFlags& flags,
                                                     const std::vector<v1::View>& views,
                                                     v1::EvaluateModelRequest& request) {
  std::vector<std::string> without;
  for (const v1::View& view : views) {
    ASSIGN_OR_RETURN(v1::SamViewMasks masks, ReadSamMasks(flags, view.view()));
    if (masks.masks().empty()) {
      without.push_back(view.view());
      continue;
    }
    masks.set_view(view.view());
    ASSIGN_OR_RETURN(*masks.mutable_ignore_png(), IgnorePng(flags, view.view()));
    *request.add_sam_views() = std::move(masks);
  }
  if (!request.sam_views().empty()) return without;
  const std::string first = without.empty() ? "" : without.front();
  return NothingThere(flags, views,
                      absl::StrCat(FileOf("", first, ".json").string(), " or masks in ",
                                   FileOf("", first, "").string(), "/"));
}

absl::Status AddNames(const std::string& file, v1::EvaluateModelRequest& request) {
  ASSIGN_OR_RETURN(const std::string text, ReadFile(file));
  const auto json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  int index = 0;
  for (const auto& [key, name] : json.items()) {
    int id = index++;
    if (!name.is_string() || (json.is_object() && !absl::SimpleAtoi(key, &id))) {
      return absl::InvalidArgumentError(
          absl::StrCat(file, ": the entry at ", key, " is not the name of an id"));
    }
    (*request.mutable_entity_names())[id] = name.get<std::string>();
  }
  if (index > 0) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(file, ": expected a JSON array of names, or an object of names by id"));
}

absl::StatusOr<std::vector<std::string>> EntitiesOf(const v1::EvaluateModelRequest& request,
                                                    const v1::ViewTruth& truth) {
  std::vector<std::string> names;
  for (const v1::EntityMask& mask : truth.masks()) names.push_back(mask.entity());
  if (truth.labels_png().empty()) return names;
  std::set<int> ids;
  if (const auto wide = DecodeGrey16(truth.labels_png(), truth.view()); wide.ok()) {
    ids.insert(wide->pixels.begin(), wide->pixels.end());
  } else {
    // Grey becomes three equal channels.
    ASSIGN_OR_RETURN(const Picture labels, DecodePicture(truth.labels_png(), truth.view()));
    for (size_t i = 0; i < labels.pixels.size(); i += 3) ids.insert(labels.pixels[i]);
  }
  ids.erase(0);
  ids.erase(VoidIdOf(request, ids));
  for (const int id : ids) {
    const auto name = request.entity_names().find(id);
    names.push_back(name == request.entity_names().end() ? absl::StrCat(id) : name->second);
  }
  return names;
}

}  // namespace pepeseg::client::cli
