// The verb that asks for masks, and what verbs ask of a model.
#include "clients/cli/questions.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/failure.h"
#include "clients/cli/prompt.h"
#include "clients/cli/shell.h"
#include "clients/cpp/mask.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

constexpr Rgb kMaskColor{255, 120, 0};
constexpr Rgb kPositive{60, 255, 60};
constexpr Rgb kNegative{255, 40, 40};

struct SegmentFlags {
  PromptFlags prompt;
  GranularityFlags granularity;
  std::vector<std::string> targets;
  std::string out;
};

void SetTargets(const std::vector<std::string>& names, v1::SegmentRequest& request) {
  using Targets = v1::SegmentRequest::Targets;
  for (const std::string& name : names) {
    if (name == "all") {
      request.mutable_targets()->set_group(Targets::GROUP_ALL);
    } else if (name == "held-out") {
      request.mutable_targets()->set_group(Targets::GROUP_HELD_OUT);
    } else {
      request.mutable_targets()->add_views(name);
    }
  }
}

absl::StatusOr<v1::SegmentRequest> BuildRequest(const SegmentFlags& flags) {
  v1::SegmentRequest request;
  request.set_model(ModelName(flags.prompt.scene, flags.prompt.model));
  ASSIGN_OR_RETURN(*request.mutable_prompt(), ParsePrompt(flags.prompt));
  *request.mutable_granularity() = ToGranularity(flags.granularity);
  SetTargets(flags.targets, request);
  request.set_mask_encoding(v1::MASK_ENCODING_COCO_RLE);
  request.set_frame(flags.prompt.frame);
  return request;
}

// STEM_mask.png, and STEM_overlay.png over the rendering.
absl::Status WriteMask(const Client& client, const SegmentFlags& flags,
                       const v1::SegmentRequest& request, const v1::SegmentResponse& answer,
                       const v1::SegmentResponse::ViewMask& view) {
  ASSIGN_OR_RETURN(const Mask mask, DecodeRle(view.rle()));
  const fs::path stem = fs::path(flags.out) / Stem(view.view());
  GreyPicture grey{view.rle().width(), view.rle().height(), mask};
  for (uint8_t& pixel : grey.pixels) pixel = pixel != 0 ? 255 : 0;
  RETURN_IF_ERROR(WritePng(stem.string() + "_mask.png", grey));
  Points points;
  if (view.view() == request.prompt().view().view()) points = request.prompt().points().points();
  ASSIGN_OR_RETURN(const Picture overlay,
                   DrawnOver(client, answer.model(), {view, points, request.frame()}));
  return WritePng(stem.string() + "_overlay.png", overlay);
}

void PrintAnswer(const v1::SegmentResponse& answer) {
  Print(absl::StrFormat("%s  scale %.3f (%.4g scene units)  threshold %.3f", answer.model(),
                        answer.scale_quantile(), answer.scale_units(), answer.threshold()));
  for (const auto& mask : answer.masks()) {
    Print(absl::StrFormat("  %-28s %8d px  score %.3f  box %d,%d %dx%d", mask.view(), mask.area(),
                          mask.score(), mask.box().x(), mask.box().y(), mask.box().width(),
                          mask.box().height()));
  }
}

absl::Status RunSegment(const Shell& shell, const SegmentFlags& flags) {
  ASSIGN_OR_RETURN(const v1::SegmentRequest request, BuildRequest(flags));
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const v1::SegmentResponse answer, client.Segment(request));
  for (const auto& mask : answer.masks()) {
    if (!flags.out.empty()) {
      RETURN_IF_ERROR(WriteMask(client, flags, request, answer, mask));
    }
  }
  shell.json ? PrintJson(answer) : PrintAnswer(answer);
  if (!flags.out.empty()) Note(absl::StrCat("masks and overlays are in ", flags.out));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Picture> RenderView(const Client& client, const std::string& model,
                                   const std::string& view, v1::PixelFrame frame) {
  v1::RenderRequest request;
  request.set_model(model);
  request.mutable_viewpoint()->set_view(view);
  request.set_frame(frame);
  ASSIGN_OR_RETURN(const v1::RenderResponse answer, client.Render(request));
  return DecodePicture(answer.png(), view);
}

absl::StatusOr<Picture> DrawnOver(const Client& client, const std::string& model,
                                  const Overlay& overlay) {
  const v1::CocoRle& rle = overlay.mask.rle();
  ASSIGN_OR_RETURN(Mask mask, DecodeRle(rle));
  ASSIGN_OR_RETURN(Picture picture, RenderView(client, model, overlay.mask.view(), overlay.frame));
  const GreyPicture resized = Resized(GreyPicture{rle.width(), rle.height(), std::move(mask)},
                                      picture.width, picture.height);
  DrawMask(picture, resized.pixels, kMaskColor);
  const double shrunk = static_cast<double>(picture.width) / rle.width();
  for (const auto& point : overlay.points) {
    DrawClick(picture, point.x() * shrunk, point.y() * shrunk,
              point.negative() ? kNegative : kPositive);
  }
  return picture;
}

std::string Stem(const std::string& view) {
  std::string stem = fs::path(view).replace_extension().generic_string();
  std::replace(stem.begin(), stem.end(), '/', '-');
  // A name comes from the server: it must not leave the folder it is written to.
  return stem.empty() || stem.front() == '.' ? "view" + stem : stem;
}

void AddSegment(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<SegmentFlags>();
  CLI::App* verb = app.add_subcommand("segment", "Masks of what a click means, in any view");
  AddAnyPromptFlags(*verb, flags->prompt);
  AddGranularityFlags(*verb, flags->granularity);
  verb->add_option("--views", flags->targets,
                   "Where masks are wanted: names, all or held-out; by default where the click is");
  verb->add_option("--out", flags->out, "Folder for STEM_mask.png and STEM_overlay.png");
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunSegment(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
