#pragma once

#include <cstdint>
#include <filesystem>

namespace pepeseg {

// Number and size of the frames of a video, by its headers. 0: unknown.
struct MovieSize {
  int64_t num_frames = 0;
  int width = 0, height = 0;  // as shown, pixels
};

// Reads the headers of an MP4 or MOV file, also a fragmented one, of an AVI, or of a Matroska or
// WebM file. Decodes nothing. Returns zeros for other formats, for malformed headers, and for
// recordings that do not state their length, as browsers make them. The frames of Matroska are its
// duration times its frame rate, or 30 a second if it states none.
MovieSize ReadMovieSize(const std::filesystem::path& path);

}  // namespace pepeseg
