#include "clients/cli/pixel_frame.h"

#include <map>

namespace pepeseg::client::cli {

CLI::Option* AddFrameFlag(CLI::App& verb, v1::PixelFrame& frame) {
  static const std::map<std::string, v1::PixelFrame> frames = {
      {"photograph", v1::PIXEL_FRAME_PHOTOGRAPH}, {"view", v1::PIXEL_FRAME_VIEW}};
  frame = v1::PIXEL_FRAME_PHOTOGRAPH;
  return verb
      .add_option_function<std::string>(
          "--frame", [&frame](const std::string& name) { frame = frames.at(name); },
          "Pixels of the uploaded photograph, or of the view that was trained on: undistorted, "
          "cropped, shrunk")
      ->check(CLI::IsMember({"photograph", "view"}))
      ->default_str("photograph");
}

PixelSize PhotographSize(const v1::View& view) {
  if (view.photograph_width() > 0) return {view.photograph_width(), view.photograph_height()};
  return {view.camera().width(), view.camera().height()};
}

}  // namespace pepeseg::client::cli
