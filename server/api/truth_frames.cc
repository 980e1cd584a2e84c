#include "server/api/truth_frames.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/dataset/dataset_files.h"
#include "core/dataset/pixel_frame.h"
#include "core/formats/images.h"
#include "server/api/segment_request.h"

namespace pepeseg {
namespace {

using Kind = TruthFrames::Kind;

// Requests are of upright pixels by contract, so the stored frame has to fit much better.
constexpr double kMuchMore = 1.3;
// Masks of a view that are compared with its photograph.
constexpr size_t kMostMasks = 256;

// The images of one kind of a view.
struct ImagesOfView {
  const ModelView* view = nullptr;
  std::vector<const std::string*> pngs;  // grey
  std::vector<const v1::MaskImage*> masks;
};

using ImagesByKind = std::map<Kind, std::map<std::string, ImagesOfView>>;

void AddPng(const std::string& png, ImagesOfView& images) {
  if (!png.empty()) images.pngs.push_back(&png);
}

// Lists the images of a request by kind and view.
ImagesByKind ListImages(const v1::EvaluateModelRequest& request) {
  ImagesByKind images;
  for (const v1::ViewTruth& truth : request.views()) {
    ImagesOfView& of_view = images[Kind::kTruth][truth.view()];
    AddPng(truth.labels_png(), of_view);
    for (const v1::EntityMask& mask : truth.masks()) of_view.masks.push_back(&mask.mask());
    AddPng(truth.ignore_png(), images[Kind::kIgnore][truth.view()]);
  }
  for (const v1::SamViewMasks& sam : request.sam_views()) {
    ImagesOfView& of_view = images[Kind::kTruth][sam.view()];
    for (const v1::SamViewMasks::SamMask& mask : sam.masks()) of_view.masks.push_back(&mask.mask());
    AddPng(sam.ignore_png(), images[Kind::kIgnore][sam.view()]);
  }
  for (const auto& [entity, prompt] : request.prompts()) {
    ImagesOfView& of_view = images[Kind::kPrompt][prompt.view().view()];
    for (const v1::MaskImage* mask : ImagesOf(prompt)) of_view.masks.push_back(mask);
  }
  return images;
}

// Returns the sizes of the images, by their headers.
std::vector<ImageSize> SizesOf(const ImagesOfView& images) {
  std::vector<ImageSize> sizes;
  for (const std::string* png : images.pngs) sizes.push_back(SizeOfPng(*png));
  for (const v1::MaskImage* mask : images.masks) sizes.push_back(SizeOf(*mask));
  return sizes;
}

// Returns one value for each pixel, which is the same where all images are the same; nothing if
// there is none of the size of `image`, or one is malformed.
absl::StatusOr<std::optional<FloatImage>> ValuesOf(const ImagesOfView& images, const Frame& image,
                                                   absl::FunctionRef<absl::Status()> check_wanted) {
  constexpr uint32_t kFactor = 131, kPrime = 16'777'213;  // exact in float
  const int width = image.width(), height = image.height();
  std::vector<uint32_t> mixed(static_cast<size_t>(width) * height, 0);
  size_t num = 0;
  const auto mix = [&](const auto& values) {
    for (size_t i = 0; i < mixed.size(); ++i) {
      const uint64_t value = uint64_t{mixed[i]} * kFactor + static_cast<uint32_t>(values[i]);
      mixed[i] = static_cast<uint32_t>(value % kPrime);
    }
    ++num;
  };
  for (const std::string* png : images.pngs) {
    RETURN_IF_ERROR(check_wanted());
    const auto grey = DecodeGreyOf(image, *png, "");
    if (!grey.ok()) return std::optional<FloatImage>();
    mix(grey->values);
  }
  for (size_t m = 0; m < std::min(images.masks.size(), kMostMasks); ++m) {
    RETURN_IF_ERROR(check_wanted());
    const auto mask = ReadMask(*images.masks[m], image, "");
    if (!mask.ok()) return std::optional<FloatImage>();
    mix(mask->pixels);
  }
  if (num == 0) return std::optional<FloatImage>();
  return FloatImage{width, height, std::vector<float>(mixed.begin(), mixed.end())};
}

// Returns at most kMaxExaminedPhotos elements, evenly spread.
std::vector<const ImagesOfView*> Spread(const std::vector<const ImagesOfView*>& all) {
  const size_t num = std::min<size_t>(all.size(), kMaxExaminedPhotos);
  std::vector<const ImagesOfView*> some;
  for (size_t i = 0; i < num; ++i) some.push_back(all[i * all.size() / num]);
  return some;
}

// Returns the frame that the borders of images fit clearly better, or nothing. `alike`: views whose
// photographs have two frames of one size.
absl::StatusOr<std::optional<PixelFrame>> FrameOf(const std::vector<const ImagesOfView*>& alike,
                                                  const std::map<std::string, int>& orientations,
                                                  ViewPhotographs& photographs,
                                                  absl::FunctionRef<absl::Status()> check_wanted) {
  FrameTrial trial(FrameTrial::Values::kLabels);
  for (const ImagesOfView* images : Spread(alike)) {
    const ModelView& view = *images->view;
    const Frame image(view);
    ASSIGN_OR_RETURN(const auto values, ValuesOf(*images, image, check_wanted));
    if (!values) continue;
    RETURN_IF_ERROR(check_wanted());
    const absl::StatusOr<Image> photo = photographs.Upright(view, kExaminedSide);
    if (!photo.ok()) continue;  // it is gone
    const int orientation = orientations.at(view.name);
    trial.Add(Upright(*photo, InverseOrientation(orientation)), orientation, *values);
  }
  RETURN_IF_ERROR(check_wanted());
  return trial.NeedsNoChoice() ? std::nullopt : trial.Verdict(kMuchMore);
}

const char* NameOf(Kind kind) {
  switch (kind) {
    case Kind::kTruth:
      return "truth";
    case Kind::kIgnore:
      return "ignore masks";
    case Kind::kPrompt:
      return "prompts";
  }
  return "";
}

}  // namespace

absl::StatusOr<TruthFrames> TruthFrames::Choose(const v1::EvaluateModelRequest& request,
                                                const Model& model, ViewPhotographs& photographs,
                                                absl::FunctionRef<absl::Status()> check_wanted) {
  TruthFrames frames;
  if (request.frame() == v1::PIXEL_FRAME_VIEW) return frames;
  ImagesByKind images = ListImages(request);
  for (const ModelView& view : model.views) {
    bool is_named = false;
    for (auto& [kind, by_view] : images) {
      const auto found = by_view.find(view.name);
      if (found == by_view.end()) continue;
      found->second.view = &view;
      is_named = true;
    }
    if (!is_named) continue;
    RETURN_IF_ERROR(check_wanted());
    const int orientation = photographs.Orientation(view);
    if (orientation != 1) frames.orientations_[view.name] = orientation;
  }
  if (frames.orientations_.empty()) return frames;
  // In the order of kinds: the truth is first, which the others follow.
  for (const auto& [kind, by_view] : images) {
    std::vector<const ImagesOfView*> alike;
    for (const auto& [name, of_view] : by_view) {
      if (!frames.orientations_.contains(name)) continue;
      const Frame image = frames.Image(*of_view.view, request.frame(), kind);
      if (image.FitsStored(image.width(), image.height())) alike.push_back(&of_view);
    }
    ASSIGN_OR_RETURN(const std::optional<PixelFrame> frame,
                     FrameOf(alike, frames.orientations_, photographs, check_wanted));
    const bool follows = !frame && frames.stored_.contains(Kind::kTruth);
    if (follows || frame == PixelFrame::kStored) frames.stored_.insert(kind);
    for (const auto& [name, of_view] : by_view) {
      if (of_view.view == nullptr) continue;
      const Frame image = frames.Image(*of_view.view, request.frame(), kind);
      const std::vector<ImageSize> sizes = SizesOf(of_view);
      const bool is_turned = std::ranges::any_of(
          sizes, [&](const ImageSize& size) { return image.TurnOf(size.width, size.height) != 1; });
      if (is_turned) frames.turned_[kind].push_back(name);
    }
  }
  return frames;
}

Frame TruthFrames::Image(const ModelView& view, v1::PixelFrame frame, Kind kind) const {
  Frame image(view, FrameKindFromProto(frame));
  const auto found = orientations_.find(view.name);
  if (found != orientations_.end()) image.AcceptStored(found->second, stored_.contains(kind));
  return image;
}

std::vector<std::string> TruthFrames::Notes() const {
  std::vector<std::string> notes;
  for (const auto& [kind, views] : turned_) {
    notes.push_back(absl::StrCat(
        "the ", NameOf(kind), " of ", views.size(),
        " views, whose photographs have an EXIF orientation, fit the stored pixels of these ",
        "photographs, not the upright ones, and are turned upright: ", FirstNames(views)));
  }
  return notes;
}

}  // namespace pepeseg
