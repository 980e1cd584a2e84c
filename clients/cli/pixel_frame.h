#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "pepeseg/v1/prompt.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

// The image whose pixels a verb's points, boxes, masks and pictures are in.
namespace pepeseg::client::cli {

// Adds --frame photograph|view, photograph by default.
CLI::Option* AddFrameFlag(CLI::App& verb, v1::PixelFrame& frame);

struct PixelSize {
  int width = 0, height = 0;

  bool operator==(const PixelSize&) const = default;
};
// Size of the uploaded photograph, or of the view where the server does not know it.
PixelSize PhotographSize(const v1::View& view);

}  // namespace pepeseg::client::cli
