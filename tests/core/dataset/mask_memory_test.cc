// Limits of the memory that reading JSON files takes, whatever the files contain; above all files
// of masks. This is a program of its own, because it replaces the allocator to count.
#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <iostream>
#include <new>
#include <string>

#include "core/dataset/sam_masks.h"
#include "core/formats/file_json.h"
#include "nlohmann/json.hpp"

namespace {

std::atomic<int64_t> allocated_bytes = 0, peak_bytes = 0;

void* Allocate(size_t size) {
  void* block = std::malloc(size);
  if (block == nullptr) std::abort();
  const auto bytes = static_cast<int64_t>(malloc_usable_size(block));
  const int64_t now = allocated_bytes += bytes;
  int64_t peak = peak_bytes;
  while (now > peak && !peak_bytes.compare_exchange_weak(peak, now)) {
  }
  return block;
}

void Free(void* block) {
  if (block == nullptr) return;
  allocated_bytes -= static_cast<int64_t>(malloc_usable_size(block));
  std::free(block);
}

}  // namespace

void* operator new(size_t size) { return Allocate(size); }
void* operator new[](size_t size) { return Allocate(size); }
void operator delete(void* block) noexcept { Free(block); }
void operator delete[](void* block) noexcept { Free(block); }
void operator delete(void* block, size_t) noexcept { Free(block); }
void operator delete[](void* block, size_t) noexcept { Free(block); }

namespace pepeseg {
namespace {

constexpr size_t kTextBytes = size_t{8} << 20;
// So large that no text of this size has too many runs for it.
const PhotoSize kLargePhoto = {"images/a.jpg", 4000, 3000};
const PhotoSize kSmallPhoto = {"images/a.jpg", 400, 300};

std::string Repeat(const std::string& begin, const std::string& piece) {
  std::string text = begin;
  text.reserve(kTextBytes + piece.size());
  while (text.size() < kTextBytes) text += piece;
  return text;
}

int64_t PeakBytes(const std::string& text, const PhotoSize& photo) {
  const int64_t before = allocated_bytes;
  peak_bytes = before;
  ParseSamMasks(text, "masks/a.json", photo).IgnoreError();
  return peak_bytes - before;
}

// Returns the peak memory per byte of text, without the text and the pixels of the result.
double BytesPerByte(const std::string& what, const std::string& text, const PhotoSize& photo) {
  const int64_t more = PeakBytes(text, photo) - PeakBytes("[]", photo);
  const double bytes = static_cast<double>(more) / static_cast<double>(text.size());
  std::cout << what << ": " << bytes << " bytes of memory a byte\n";
  return bytes;
}

const char kRuns[] = R"([{"segmentation":{"size":[3000,4000],"counts":[)";
const char kCompressedRuns[] = R"([{"segmentation":{"size":[3000,4000],"counts":")";

TEST(MaskMemory, DoesNotGrowWithNesting) {
  EXPECT_LT(BytesPerByte("nested lists", std::string(kTextBytes, '['), kSmallPhoto), 0.2);
  EXPECT_LT(BytesPerByte("nested objects", Repeat("[", R"({"a":)"), kSmallPhoto), 0.2);
}

TEST(FileJsonMemory, DoesNotGrowWithNesting) {
  for (const std::string& text :
       {std::string(kTextBytes, '['), Repeat("[", R"({"a":)"), Repeat("", "[[],")}) {
    const int64_t before = allocated_bytes;
    peak_bytes = before;
    EXPECT_FALSE(ParseFileJson(text).ok());
    EXPECT_LT(peak_bytes - before, 100'000) << text.substr(0, 10);
  }
}

TEST(MaskMemory, DoesNotGrowWithSkippedValues) {
  EXPECT_LT(BytesPerByte("numbers", Repeat("[[", "1,"), kSmallPhoto), 0.2);
  EXPECT_LT(BytesPerByte("members", Repeat("[{", R"("a":1,)"), kSmallPhoto), 0.2);
}

// The parser keeps one token, or a series of brackets, for its error message.
TEST(MaskMemory, HoldsOneTokenAtATime) {
  EXPECT_LT(BytesPerByte("lists", Repeat("[[", "[],"), kSmallPhoto), 6);
  EXPECT_LT(BytesPerByte("masks", Repeat("[", "{},"), kSmallPhoto), 6);
  EXPECT_LT(BytesPerByte("one long name", Repeat("[{\"", "abcdefgh"), kSmallPhoto), 12);
  EXPECT_LT(BytesPerByte("one long number", Repeat("[", "12345678"), kSmallPhoto), 12);
}

TEST(MaskMemory, HoldsTheRunsOfOneMask) {
  EXPECT_LT(BytesPerByte("runs", Repeat(kRuns, "1,"), kLargePhoto), 4.2);
  const std::string counts = Repeat(kCompressedRuns, "1") + "\"}}]";
  EXPECT_LT(BytesPerByte("compressed runs", counts, kLargePhoto), 18);
  // At most one run per pixel, if the photograph has fewer pixels than the text has characters.
  EXPECT_LT(BytesPerByte("runs of a small photograph", Repeat(kRuns, "1,"), kSmallPhoto), 0.2);
}

}  // namespace
}  // namespace pepeseg
