#include "clients/terminal/view_picture.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "clients/cpp/file_bytes.h"
#include "clients/cpp/mask.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

constexpr Rgb kPositive{60, 255, 60};
constexpr Rgb kNegative{255, 40, 40};

v1::RenderViewRequest RequestOf(const std::string& model, const std::string& view,
                                v1::PixelFrame frame) {
  v1::RenderViewRequest request;
  request.set_model(model);
  request.mutable_viewpoint()->set_view(view);
  request.set_frame(frame);
  return request;
}

// Has the server draw the mask: its picture is the larger part of the work, and without points the
// client needs no pixel of it.
absl::StatusOr<v1::RenderViewResponse> RenderOverlay(const Client& client, const std::string& model,
                                                     const Overlay& overlay) {
  v1::RenderViewRequest request = RequestOf(model, overlay.mask.view(), overlay.frame);
  // An empty mask is refused as an overlay.
  if (overlay.mask.area() > 0) {
    *request.mutable_overlay_mask()->mutable_rle() = overlay.mask.rle();
  }
  return client.Render(request);
}

}  // namespace

PixelSize PhotographSize(const v1::View& view) {
  if (view.photograph_width() > 0) return {view.photograph_width(), view.photograph_height()};
  return {view.camera().width(), view.camera().height()};
}

absl::StatusOr<Picture> RenderView(const Client& client, const std::string& model,
                                   const std::string& view, v1::PixelFrame frame) {
  ASSIGN_OR_RETURN(const v1::RenderViewResponse answer,
                   client.Render(RequestOf(model, view, frame)));
  return DecodePicture(answer.png(), view);
}

absl::StatusOr<Picture> DrawnOver(const Client& client, const std::string& model,
                                  const Overlay& overlay) {
  ASSIGN_OR_RETURN(const v1::RenderViewResponse answer, RenderOverlay(client, model, overlay));
  ASSIGN_OR_RETURN(Picture picture, DecodePicture(answer.png(), overlay.mask.view()));
  // The server may have shrunk the rendering: bring the points to its size.
  const double shrink = static_cast<double>(picture.width) / overlay.mask.rle().width();
  for (const auto& point : overlay.points) {
    DrawClick(picture, point.x() * shrink, point.y() * shrink,
              point.negative() ? kNegative : kPositive);
  }
  return picture;
}

absl::Status WriteDrawnOver(const std::filesystem::path& path, const Client& client,
                            const std::string& model, const Overlay& overlay) {
  if (overlay.points.empty()) {
    ASSIGN_OR_RETURN(const v1::RenderViewResponse answer, RenderOverlay(client, model, overlay));
    return WriteFile(path, answer.png());
  }
  ASSIGN_OR_RETURN(const Picture picture, DrawnOver(client, model, overlay));
  return WritePng(path, picture);
}

absl::Status WriteMask(const std::filesystem::path& path, const v1::CocoRle& rle) {
  ASSIGN_OR_RETURN(Mask mask, DecodeRle(rle));
  GreyPicture grey{rle.width(), rle.height(), std::move(mask)};
  for (uint8_t& pixel : grey.pixels) pixel = pixel != 0 ? 255 : 0;
  return WritePng(path, grey);
}

std::string Stem(const std::string& view) {
  std::string stem = std::filesystem::path(view).replace_extension().generic_string();
  std::replace(stem.begin(), stem.end(), '/', '-');
  // The name comes from the server: it must not lead out of the folder that the file is written to.
  return stem.empty() || stem.front() == '.' ? "view" + stem : stem;
}

}  // namespace pepeseg::client::cli
