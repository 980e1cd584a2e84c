#include "core/formats/movie_size.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <fstream>
#include <string>

#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

// Returns the lowest bytes of a number, the highest first.
std::string BigEndian(uint64_t value, int num_bytes) {
  std::string bytes;
  for (int i = num_bytes - 1; i >= 0; --i) bytes.push_back(static_cast<char>(value >> (8 * i)));
  return bytes;
}

std::string LittleEndian(uint32_t value) {
  const std::string bytes = BigEndian(value, 4);
  return {bytes.rbegin(), bytes.rend()};
}

// A box of MP4.
std::string Box(const std::string& type, const std::string& content) {
  return BigEndian(content.size() + 8, 4) + type + content;
}

// A chunk of RIFF, and a list of chunks.
std::string Chunk(const std::string& type, const std::string& content) {
  return type + LittleEndian(static_cast<uint32_t>(content.size())) + content +
         std::string(content.size() % 2, '\0');
}
std::string List(const std::string& type, const std::string& chunks) {
  return Chunk("LIST", type + chunks);
}

// An element of Matroska. `id` has its marker, and the size has eight bytes.
std::string Element(uint64_t id, const std::string& content) {
  int length = 1;
  while (id >> (8 * length) != 0) ++length;
  return BigEndian(id, length) + BigEndian(uint64_t{1} << 56 | content.size(), 8) + content;
}

class MovieSizeTest : public ::testing::Test {
 protected:
  MovieSize Read(const std::string& bytes) const {
    const std::filesystem::path path = folder_ / "blob";
    std::ofstream(path, std::ios::binary) << bytes;
    return ReadMovieSize(path);
  }

 private:
  const testing::TempFolder folder_;
};

std::string AviHeader(uint32_t num_frames) {
  return Chunk("avih", std::string(16, '\0') + LittleEndian(num_frames) + std::string(12, '\0') +
                           LittleEndian(640) + LittleEndian(480) + std::string(16, '\0'));
}

std::string AviStream(const std::string& type, uint32_t length) {
  return List("strl", Chunk("strh", type + std::string(28, '\0') + LittleEndian(length) +
                                        std::string(20, '\0')));
}

TEST_F(MovieSizeTest, IsReadFromTheHeadersOfAvi) {
  const std::string head =
      List("hdrl", AviHeader(90) + AviStream("auds", 5000) + AviStream("vids", 90));
  const MovieSize size =
      Read("RIFF" + LittleEndian(9999) + "AVI " + Chunk("JUNK", "odd") + head +
           List("movi", Chunk("dmlh", LittleEndian(777))));  // a frame that looks like a header
  EXPECT_EQ(size.num_frames, 90);
  EXPECT_EQ(size.width, 640);
  EXPECT_EQ(size.height, 480);
}

// Above 1 GiB, "avih" counts the frames of the first RIFF chunk only.
TEST_F(MovieSizeTest, CountsAllRiffChunksOfAnAvi) {
  const std::string head = List("hdrl", AviHeader(90) + AviStream("vids", 90) +
                                            List("odml", Chunk("dmlh", LittleEndian(54321))));
  EXPECT_EQ(Read("RIFF" + LittleEndian(9999) + "AVI " + head).num_frames, 54321);
}

// `duration` is in units of `scale` nanoseconds; 0: it is left out, as is the duration of a frame.
std::string Matroska(double duration, uint64_t scale, uint64_t frame_nanoseconds) {
  std::string info = Element(0x2ad7b1, BigEndian(scale, 3));
  if (duration > 0) info += Element(0x4489, BigEndian(std::bit_cast<uint64_t>(duration), 8));
  std::string video = Element(0x83, "\x01");
  if (frame_nanoseconds > 0) video += Element(0x23e383, BigEndian(frame_nanoseconds, 4));
  video += Element(0xe0, Element(0xb0, BigEndian(1920, 2)) + Element(0xba, BigEndian(1080, 2)));
  const std::string audio = Element(0x83, "\x02") + Element(0x23e383, BigEndian(21333333, 4));
  // The segment's size is unknown, as in a recording.
  return Element(0x1a45dfa3, Element(0x4282, "webm")) + BigEndian(0x18538067, 4) +
         BigEndian(0x01ffffffffffffff, 8) + Element(0xec, "void") + Element(0x1549a966, info) +
         Element(0x1654ae6b, Element(0xae, audio) + Element(0xae, video));
}

TEST_F(MovieSizeTest, IsReadFromTheHeadersOfMatroska) {
  const MovieSize size = Read(Matroska(2000, 1000000, 40000000));
  EXPECT_EQ(size.num_frames, 50);
  EXPECT_EQ(size.width, 1920);
  EXPECT_EQ(size.height, 1080);
  EXPECT_EQ(Read(Matroska(2000, 1000000, 0)).num_frames, 60) << "30 frames a second";
  EXPECT_EQ(Read(Matroska(2e6, 1000, 40000000)).num_frames, 50) << "in microseconds";
  EXPECT_EQ(Read(Matroska(0, 1000000, 40000000)).num_frames, 0) << "a recording of a browser";
  EXPECT_EQ(Read(Matroska(1e300, 1000000, 1)).num_frames, 0);
  EXPECT_EQ(Read(Matroska(std::bit_cast<double>(0x7ff8000000000000), 1000, 1)).num_frames, 0);
}

// The moov of a fragmented MP4 has no samples. Track 2 is the video.
std::string Fragmented(const std::string& fragments) {
  const auto track = [](uint64_t id, const std::string& handler) {
    const std::string head = std::string(12, '\0') + BigEndian(id, 4) + std::string(60, '\0') +
                             BigEndian(640 << 16, 4) + BigEndian(480 << 16, 4);
    const std::string table = Box("stbl", Box("stsz", std::string(12, '\0')));
    return Box("trak", Box("tkhd", head) + Box("mdia", Box("hdlr", std::string(8, '\0') + handler) +
                                                           Box("minf", table)));
  };
  return Box("ftyp", "iso5") + Box("moov", track(1, "soun") + track(2, "vide")) + fragments;
}

std::string Fragment(uint64_t track, const std::string& runs) {
  return Box("traf", Box("tfhd", std::string(4, '\0') + BigEndian(track, 4)) + runs);
}

std::string SampleRun(uint64_t num_samples) {
  return Box("trun", std::string(4, '\0') + BigEndian(num_samples, 4));
}

TEST_F(MovieSizeTest, CountsTheFragmentsOfAnMp4) {
  const std::string first =
      Box("moof", Fragment(1, SampleRun(1000)) + Fragment(2, SampleRun(25) + SampleRun(5)));
  const std::string second = Box("moof", Fragment(2, SampleRun(12)));
  const MovieSize size = Read(Fragmented(first + Box("mdat", "frames") + second));
  EXPECT_EQ(size.num_frames, 42);
  EXPECT_EQ(size.width, 640);
  EXPECT_EQ(size.height, 480);
}

TEST_F(MovieSizeTest, IsUnknownForFilesThatAreCutShort) {
  const std::string matroska = Matroska(2000, 1000000, 40000000);
  const std::string avi =
      "RIFF" + LittleEndian(9999) + "AVI " + List("hdrl", AviHeader(90) + AviStream("vids", 90));
  const std::string mp4 = Fragmented(Box("moof", Fragment(2, SampleRun(25))));
  for (const std::string& whole : {matroska, avi, mp4}) {
    for (size_t length = 0; length < whole.size(); ++length) {
      EXPECT_LE(Read(whole.substr(0, length)).num_frames, 90) << length;
    }
  }
  EXPECT_EQ(Read("").num_frames, 0);
  EXPECT_EQ(Read("RIFF").num_frames, 0);
  EXPECT_EQ(Read(std::string(4096, '\xff')).num_frames, 0);
}

}  // namespace
}  // namespace pepeseg
