#pragma once

#include <cstdint>
#include <vector>

// The interface of the module "video" (core/base/module.h), which has FFmpeg. Program and module
// are built together. No exception passes through it but std::bad_alloc.
namespace pepeseg {

// The pictures of a file's first video track, one after the other, as stored: not rotated, colours
// by BT.601.
class VideoDecoder {
 public:
  virtual ~VideoDecoder() = default;

  // Size that the file declares.
  virtual int width() const = 0;
  virtual int height() const = 0;
  // Number of frames that the file declares, or its length in frames. 0: unknown. It may be wrong.
  virtual int64_t num_frames() const = 0;

  // Moves to the next frame; the first call to the first one. Returns false at the end, or where
  // the file does not decode further.
  virtual bool Next() = 0;
  // Sets `bgr` to the picture of this frame, 8-bit BGR [height, width]. Returns false if it does
  // not decode, or to another size.
  virtual bool Picture(std::vector<uint8_t>& bgr) = 0;
};

// Opens a file by its absolute path. Returns null if FFmpeg cannot read it. The caller deletes it.
using OpenVideoFn = VideoDecoder*(const char* path);
inline constexpr char kOpenVideo[] = "PepesegOpenVideo";  // name of the function in the module

}  // namespace pepeseg
