#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

// The boxes of MP4 and MOV files (ISO/IEC 14496-12): a 32-bit big-endian size that includes itself,
// a type of four letters, and the content. Malformed boxes are empty, and numbers beyond the end
// are 0, so that callers need no other checks.
namespace pepeseg {

// Returns the big-endian number of `length` bytes at `at`, or 0 beyond the end.
uint64_t BoxNumber(std::string_view bytes, size_t at, size_t length);

// Returns the content of the first box of a type among `boxes`, or nothing.
std::string_view Box(std::string_view boxes, std::string_view type);

// Returns the content of the file's box "moov", which may follow gigabytes of samples. Empty: the
// file has another format, cannot be read, or the box exceeds 64 MiB.
std::string ReadMovieBox(const std::filesystem::path& path);

// Returns the content of the first video track ("trak") of a movie box, and the sample table
// ("stbl") of a track; empty if there is none.
std::string_view FirstVideoTrack(std::string_view movie);
std::string_view SampleTable(std::string_view track);

// Number and size of the frames of a video, by its header. 0: unknown.
struct MovieSize {
  int64_t num_frames = 0;
  int width = 0, height = 0;  // as shown, pixels
};

// Reads the header of an MP4 or MOV file. Returns zeros for other formats, for fragmented files,
// and for malformed headers. Reads at most 64 MiB and decodes nothing.
MovieSize ReadMovieSize(const std::filesystem::path& path);

}  // namespace pepeseg
