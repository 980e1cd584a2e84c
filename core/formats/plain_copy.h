#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// What the program that gets the copy can read.
struct PlainCopyOptions {
  bool upright = true;  // turns the pixels by the EXIF orientation; false: ignores it
  bool webp = false;    // the program reads WebP
};

// Returns a copy of a photograph for a program that we call: a JPEG or PNG with 8 bits a channel,
// grey or RGB, without palette and alpha, and with upright pixels. A JPEG keeps its other EXIF
// data, from which programs take the focal length. Returns an empty string if `bytes`, a file that
// `name` names, is such a photograph already. Errors as DecodePhoto.
absl::StatusOr<std::string> PlainCopy(std::span<const uint8_t> bytes, absl::string_view name,
                                      const PlainCopyOptions& options = {});

}  // namespace pepeseg
