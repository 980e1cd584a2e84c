#include "tests/testing/unzipped.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstdint>
#include <utility>

namespace pepeseg::testing {
namespace {

uint64_t NumberAt(absl::string_view bytes, size_t at, int size) {
  uint64_t number = 0;
  for (int i = size; i-- > 0;) {
    number = number << 8 | static_cast<uint8_t>(bytes.at(at + static_cast<size_t>(i)));
  }
  return number;
}

std::string Inflated(absl::string_view bytes, size_t size) {
  z_stream stream = {};
  EXPECT_EQ(inflateInit2(&stream, -MAX_WBITS), Z_OK);
  std::string out(size, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  EXPECT_EQ(stream.total_out, size);
  inflateEnd(&stream);
  return out;
}

}  // namespace

std::map<std::string, std::string> Unzipped(absl::string_view zip) {
  std::map<std::string, std::string> files;
  constexpr size_t kEnd = 22, kEntry = 46, kLocal = 30, kLocator = 20;
  if (zip.size() < kEnd || zip.substr(zip.size() - kEnd, 4) != "PK\5\6") {
    ADD_FAILURE() << "no zip of " << zip.size() << " bytes";
    return files;
  }
  const size_t end = zip.size() - kEnd;
  uint64_t count = NumberAt(zip, end + 10, 2);
  if (count == UINT16_MAX) {
    EXPECT_EQ(zip.substr(end - kLocator, 4), "PK\6\7");
    const size_t record = NumberAt(zip, end - kLocator + 8, 8);
    EXPECT_EQ(zip.substr(record, 4), "PK\6\6");
    count = NumberAt(zip, record + 32, 8);
    EXPECT_EQ(NumberAt(zip, record + 48, 8), NumberAt(zip, end + 16, 4));
  }
  size_t at = NumberAt(zip, end + 16, 4);
  const size_t directory = at;
  for (uint64_t i = 0; i < count; ++i) {
    EXPECT_EQ(zip.substr(at, 4), "PK\1\2");
    const size_t name_size = NumberAt(zip, at + 28, 2);
    const std::string name(zip.substr(at + kEntry, name_size));
    const size_t local = NumberAt(zip, at + 42, 4);
    EXPECT_EQ(zip.substr(local, 4), "PK\3\4");
    EXPECT_EQ(zip.substr(local + 4, 26), zip.substr(at + 6, 26))
        << "the record of " << name << " is not as in the directory";
    EXPECT_EQ(zip.substr(local + kLocal, name_size), name);
    const auto stored = zip.substr(local + kLocal + name_size, NumberAt(zip, at + 20, 4));
    const size_t size = NumberAt(zip, at + 24, 4);
    const bool is_deflated = NumberAt(zip, at + 10, 2) == Z_DEFLATED;
    std::string bytes = is_deflated ? Inflated(stored, size) : std::string(stored);
    EXPECT_EQ(bytes.size(), size) << name;
    EXPECT_EQ(
        crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())),
        NumberAt(zip, at + 16, 4))
        << name;
    EXPECT_TRUE(files.emplace(name, std::move(bytes)).second) << name;
    at += kEntry + name_size;
  }
  EXPECT_EQ(at - directory, NumberAt(zip, end + 12, 4));
  return files;
}

}  // namespace pepeseg::testing
