#include "server/api/evaluation_views.h"

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/images.h"
#include "server/api/error.h"
#include "server/api/request_image.h"
#include "server/api/segment_request.h"

namespace pepeseg {
namespace {

constexpr int kMaxEvaluatedViews = 1000;
constexpr int64_t kMaxEvaluatedPixels = 64'000'000;  // of all views together
// Of the bitsets of all views. Masks that cut each other into many cells take more than their
// pixels, and a few megabytes of a request could ask for gigabytes.
constexpr int64_t kMaxTruthBitsetBytes = int64_t{128} << 20;
constexpr size_t kMaxEntityName = 256;
constexpr int kMaxLabel = 65'535;  // of a label image
constexpr double kKeepAll = 1;     // no IoU exceeds it: SAM's scores belong to masks by index

absl::Status CheckEntityName(const std::string& name, const std::string& field) {
  if (!name.empty() && name.size() <= kMaxEntityName) return absl::OkStatus();
  return BadField(field, absl::StrCat(name.size()),
                  absl::StrCat("bytes of a name; allowed are 1..", kMaxEntityName));
}

// Returns the error of core with the path of the field that it is about.
absl::Status InField(const absl::Status& status, const std::string& field) {
  if (status.ok()) return status;
  return WithDetail(
      absl::Status(status.code(), absl::StrCat(field, ": ", std::string(status.message()))),
      {.reason = "BAD_FIELD", .field = field});
}

// Takes images of a request to one view. Keeps the mapping, which costs a search for each pixel.
class ToViewPixels {
 public:
  ToViewPixels(const ModelView& view, v1::PixelFrame frame, const TruthFrames& frames)
      : image_(frames.Image(view, frame, TruthFrames::Kind::kTruth)),
        ignore_image_(frames.Image(view, frame, TruthFrames::Kind::kIgnore)) {}

  const Frame& image() const { return image_; }

  template <class T>
  std::vector<T> Take(const std::vector<T>& values) {
    if (image_.is_view()) return values;
    if (!pixels_) pixels_ = image_.PixelsOfView();
    std::vector<T> taken;
    taken.reserve(pixels_->size());
    for (const int32_t pixel : *pixels_) taken.push_back(values[static_cast<size_t>(pixel)]);
    return taken;
  }

  // Returns the ignored pixels of the view, empty if there is no image.
  absl::StatusOr<std::vector<uint8_t>> ReadIgnore(const std::string& png,
                                                  const std::string& field) const {
    std::vector<uint8_t> ignore;
    if (png.empty()) return ignore;
    ASSIGN_OR_RETURN(const FloatImage grey, DecodeGreyOf(ignore_image_, png, field));
    ignore.reserve(grey.values.size());
    for (const float value : grey.values) ignore.push_back(value != 0 ? 1 : 0);
    return image_.TakeIgnoreToView(ignore);
  }

 private:
  const Frame image_, ignore_image_;
  std::optional<std::vector<int32_t>> pixels_;
};

// Checks the views of a request one by one, and what they take together.
class EvaluatedViews {
 public:
  EvaluatedViews(const v1::EvaluateModelRequest& request, const Model& model)
      : accept_trained_(request.options().accept_trained_views()), model_(model) {}

  static absl::Status CheckCount(int count, const std::string& field) {
    if (count >= 1 && count <= kMaxEvaluatedViews) return absl::OkStatus();
    return BadField(field, absl::StrCat(count),
                    absl::StrCat("views; allowed are 1..", kMaxEvaluatedViews));
  }

  absl::StatusOr<ModelView> Find(const std::string& name, const std::string& field) {
    // Two images of one view would count its pixels twice.
    if (!names_.insert(name).second) return BadField(field, name, "is given twice");
    ASSIGN_OR_RETURN(ModelView view, FindView(name, model_, field));
    if (!view.held_out && !accept_trained_) {
      return BadField(field, name,
                      "was trained on; score held-out views, or set options.accept_trained_views "
                      "where the protocol scores trained ones");
    }
    num_pixels_ += int64_t{view.camera.width} * view.camera.height;
    if (num_pixels_ <= kMaxEvaluatedPixels) return view;
    return BadField(field, name,
                    absl::StrCat("over ", kMaxEvaluatedPixels, " pixels with the views before it"));
  }

  // Counts the bitsets of a view whose masks are complete, or checks those of the current one.
  void AddBitsets(int64_t num_bytes) { bitset_bytes_ += num_bytes; }
  absl::Status CheckBitsets(int64_t num_bytes, const std::string& field) const {
    if (bitset_bytes_ + num_bytes <= kMaxTruthBitsetBytes) return absl::OkStatus();
    return BadField(field, absl::StrCat(bitset_bytes_ + num_bytes),
                    absl::StrCat("bytes for the overlaps of the masks so far; allowed are ",
                                 kMaxTruthBitsetBytes));
  }

 private:
  const bool accept_trained_;
  const Model& model_;
  std::set<std::string> names_;
  int64_t num_pixels_ = 0;
  int64_t bitset_bytes_ = 0;
};

absl::StatusOr<std::map<int, std::string>> ReadEntityNames(
    const v1::EvaluateModelRequest& request) {
  std::map<int, std::string> names;
  for (const auto& [id, name] : request.entity_names()) {
    RETURN_IF_ERROR(CheckEntityName(name, absl::StrCat("entity_names[", id, "]")));
    names[id] = name;
  }
  return names;
}

absl::StatusOr<std::optional<int>> ReadIgnoreLabel(const v1::EvaluateModelRequest& request) {
  if (!request.has_ignore_label()) return std::nullopt;
  const int label = request.ignore_label();
  if (label >= 1 && label <= kMaxLabel) return label;
  return BadField("ignore_label", absl::StrCat(label),
                  absl::StrCat("allowed are 1..", kMaxLabel, "; pixels of 0 are in no entity"));
}

// Returns whether a label image is one binary mask with soft borders, whose other values are no
// ids.
bool IsSoftMask(const std::vector<uint16_t>& ids, int width, int height) {
  const LabelImage image = {width, height, std::vector<uint32_t>(ids.begin(), ids.end())};
  return SoftMaskThreshold(image).has_value();
}

// Reads the truth of one view.
class TruthReader {
 public:
  TruthReader(const v1::ViewTruth& proto, std::string field, ModelView view, v1::PixelFrame frame,
              const TruthFrames& frames)
      : proto_(proto),
        field_(std::move(field)),
        to_view_(view, frame, frames),
        builder_(std::move(view)) {}

  // ignore_label: EvaluateModelRequest.ignore_label. The image, not the part of it that the view
  // shows, decides what is void.
  absl::Status ReadLabels(const std::map<int, std::string>& names,
                          std::optional<int> ignore_label) {
    if (proto_.labels_png().empty()) return absl::OkStatus();
    const std::string field = field_ + ".labels_png";
    // Ids are compared as whole numbers, so the nearest pixel is taken, without blending two ids.
    ASSIGN_OR_RETURN(const FloatImage grey,
                     DecodeGreyOf(to_view_.image(), proto_.labels_png(), field));
    const std::vector<uint16_t> ids(grey.values.begin(), grey.values.end());
    std::optional<int> void_label = ignore_label;
    if (!ignore_label && !IsSoftMask(ids, grey.width, grey.height)) {
      void_label = VoidLabelOf(ids);
      if (void_label && names.contains(*void_label)) void_label.reset();
    }
    return InField(builder_.AddLabels(to_view_.Take(ids), names, void_label), field);
  }

  absl::Status ReadMask(int index) {
    const v1::EntityMask& mask = proto_.masks(index);
    const std::string field = absl::StrCat(field_, ".masks[", index, "]");
    RETURN_IF_ERROR(CheckEntityName(mask.entity(), field + ".entity"));
    ASSIGN_OR_RETURN(const BinaryMask read,
                     pepeseg::ReadMask(mask.mask(), to_view_.image(), field + ".mask"));
    return InField(builder_.AddMask(mask.entity(), to_view_.Take(read.pixels)), field);
  }

  absl::StatusOr<TruthView> Finish() && {
    ASSIGN_OR_RETURN(const std::vector<uint8_t> ignore,
                     to_view_.ReadIgnore(proto_.ignore_png(), field_ + ".ignore_png"));
    if (!ignore.empty()) RETURN_IF_ERROR(builder_.AddIgnore(ignore));
    return std::move(builder_).Build();
  }

  int64_t BitsetBytes() const { return builder_.BitsetBytes(); }

 private:
  const v1::ViewTruth& proto_;
  const std::string field_;
  ToViewPixels to_view_;
  TruthViewBuilder builder_;
};

// Reads SAM's masks of one view into `sam`, whose view is set.
absl::Status ReadSamMasks(const v1::SamViewMasks& proto, const std::string& field,
                          const EvaluatedViews& views, ToViewPixels& to_view,
                          absl::FunctionRef<absl::Status()> check_wanted, SamView& sam) {
  MaskSetBuilder builder(sam.view.camera.width, sam.view.camera.height, kKeepAll);
  for (int m = 0; m < proto.masks_size(); ++m) {
    RETURN_IF_ERROR(check_wanted());
    const v1::SamViewMasks::SamMask& mask = proto.masks(m);
    const std::string of_mask = absl::StrCat(field, ".masks[", m, "]");
    ASSIGN_OR_RETURN(const BinaryMask read,
                     ReadMask(mask.mask(), to_view.image(), of_mask + ".mask"));
    const std::vector<uint8_t> in_view = to_view.Take(read.pixels);
    std::vector<uint32_t> pixels;
    for (size_t i = 0; i < in_view.size(); ++i) {
      if (in_view[i] != 0) pixels.push_back(static_cast<uint32_t>(i));
    }
    if (!builder.Add(pixels)) continue;  // of which the view shows nothing
    RETURN_IF_ERROR(views.CheckBitsets(builder.BitsetBytes(), of_mask));
    sam.predicted_iou.push_back(mask.has_predicted_iou() ? mask.predicted_iou() : 1);
    sam.stability.push_back(mask.has_stability() ? mask.stability() : 1);
  }
  sam.masks = std::move(builder).Build();
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<TruthView>> ReadTruthViews(
    const v1::EvaluateModelRequest& request, const Model& model,
    absl::FunctionRef<absl::Status()> check_wanted, const TruthFrames& frames) {
  RETURN_IF_ERROR(CheckFrame(request.frame()));
  RETURN_IF_ERROR(EvaluatedViews::CheckCount(request.views_size(), "views"));
  ASSIGN_OR_RETURN(const auto names, ReadEntityNames(request));
  ASSIGN_OR_RETURN(const std::optional<int> ignore_label, ReadIgnoreLabel(request));
  EvaluatedViews views(request, model);
  std::vector<TruthView> truths;
  for (int i = 0; i < request.views_size(); ++i) {
    RETURN_IF_ERROR(check_wanted());
    const v1::ViewTruth& proto = request.views(i);
    const std::string field = absl::StrCat("views[", i, "]");
    ASSIGN_OR_RETURN(ModelView view, views.Find(proto.view(), field + ".view"));
    TruthReader reader(proto, field, std::move(view), request.frame(), frames);
    RETURN_IF_ERROR(reader.ReadLabels(names, ignore_label));
    for (int m = 0; m < proto.masks_size(); ++m) {
      RETURN_IF_ERROR(check_wanted());
      RETURN_IF_ERROR(reader.ReadMask(m));
      RETURN_IF_ERROR(
          views.CheckBitsets(reader.BitsetBytes(), absl::StrCat(field, ".masks[", m, "]")));
    }
    views.AddBitsets(reader.BitsetBytes());
    ASSIGN_OR_RETURN(truths.emplace_back(), std::move(reader).Finish());
  }
  return truths;
}

absl::StatusOr<std::vector<SamView>> ReadSamViews(const v1::EvaluateModelRequest& request,
                                                  const Model& model,
                                                  absl::FunctionRef<absl::Status()> check_wanted,
                                                  const TruthFrames& frames) {
  RETURN_IF_ERROR(CheckFrame(request.frame()));
  RETURN_IF_ERROR(EvaluatedViews::CheckCount(request.sam_views_size(), "sam_views"));
  EvaluatedViews views(request, model);
  std::vector<SamView> read;
  for (int i = 0; i < request.sam_views_size(); ++i) {
    const v1::SamViewMasks& proto = request.sam_views(i);
    const std::string field = absl::StrCat("sam_views[", i, "]");
    SamView& sam = read.emplace_back();
    ASSIGN_OR_RETURN(sam.view, views.Find(proto.view(), field + ".view"));
    ToViewPixels to_view(sam.view, request.frame(), frames);
    RETURN_IF_ERROR(ReadSamMasks(proto, field, views, to_view, check_wanted, sam));
    views.AddBitsets(static_cast<int64_t>(sam.masks.cell_bits.size()) * 8);
    ASSIGN_OR_RETURN(sam.ignore, to_view.ReadIgnore(proto.ignore_png(), field + ".ignore_png"));
  }
  return read;
}

}  // namespace pepeseg
