#include "clients/terminal/view_picture.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "clients/cpp/mask.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

constexpr Rgb kMaskColor{255, 120, 0};
constexpr Rgb kPositive{60, 255, 60};
constexpr Rgb kNegative{255, 40, 40};

}  // namespace

PixelSize PhotographSize(const v1::View& view) {
  if (view.photograph_width() > 0) return {view.photograph_width(), view.photograph_height()};
  return {view.camera().width(), view.camera().height()};
}

absl::StatusOr<Picture> RenderView(const Client& client, const std::string& model,
                                   const std::string& view, v1::PixelFrame frame) {
  v1::RenderViewRequest request;
  request.set_model(model);
  request.mutable_viewpoint()->set_view(view);
  request.set_frame(frame);
  ASSIGN_OR_RETURN(const v1::RenderViewResponse answer, client.Render(request));
  return DecodePicture(answer.png(), view);
}

absl::StatusOr<Picture> DrawnOver(const Client& client, const std::string& model,
                                  const Overlay& overlay) {
  const v1::CocoRle& rle = overlay.mask.rle();
  ASSIGN_OR_RETURN(Mask mask, DecodeRle(rle));
  ASSIGN_OR_RETURN(Picture picture, RenderView(client, model, overlay.mask.view(), overlay.frame));
  // The server may have shrunk the rendering: bring the mask and the points to its size.
  const GreyPicture resized = Resized(GreyPicture{rle.width(), rle.height(), std::move(mask)},
                                      picture.width, picture.height);
  DrawMask(picture, resized.pixels, kMaskColor);
  const double shrink = static_cast<double>(picture.width) / rle.width();
  for (const auto& point : overlay.points) {
    DrawClick(picture, point.x() * shrink, point.y() * shrink,
              point.negative() ? kNegative : kPositive);
  }
  return picture;
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
