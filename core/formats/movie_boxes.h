#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "absl/functional/function_ref.h"

// The boxes of MP4 and MOV files (ISO/IEC 14496-12): a 32-bit big-endian size that includes itself,
// a type of four letters, and the content. Malformed boxes are empty, and numbers beyond the end
// are 0, so that callers need no other checks.
namespace pepeseg {

// Returns the big-endian number of `length` bytes at `at`, or 0 beyond the end.
uint64_t BoxNumber(std::string_view bytes, size_t at, size_t length);

// Returns the content of the first box of a type among `boxes`, or nothing.
std::string_view Box(std::string_view boxes, std::string_view type);

// Calls use(type, content) for each box of `boxes` until it returns true.
void ForEachBox(std::string_view boxes,
                absl::FunctionRef<bool(std::string_view type, std::string_view content)> use);

// Calls `use` with the content of each box of a type at the top of a file, in their order, until it
// returns true. Reads at most 4096 boxes, and ends at one of that type above 64 MiB.
void ForEachFileBox(const std::filesystem::path& path, std::string_view type,
                    absl::FunctionRef<bool(std::string_view content)> use);

// Returns the content of the file's box "moov", which may follow gigabytes of samples. Empty: the
// file has another format, cannot be read, or the box exceeds 64 MiB.
std::string ReadMovieBox(const std::filesystem::path& path);

// Returns the content of the first video track ("trak") of a movie box, and the sample table
// ("stbl") of a track; empty if there is none.
std::string_view FirstVideoTrack(std::string_view movie);
std::string_view SampleTable(std::string_view track);

}  // namespace pepeseg
