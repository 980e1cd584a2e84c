#include "tests/testing/test_video.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>
#include <utility>

#include "opencv2/imgproc.hpp"
#include "opencv2/videoio.hpp"

namespace pepeseg::testing {
namespace {

void SetWord(std::string& bytes, size_t at, uint32_t value) {
  for (size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<char>(value >> (24 - 8 * i));
}

uint32_t WordAt(const std::string& bytes, size_t at) {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<uint8_t>(bytes[at + i]);
  return value;
}

// Appends a box "colr" to the sample entry of an MP4 whose samples precede its header.
void AddColours(int matrix_coefficients, std::string& bytes) {
  std::string box(19, '\0');
  SetWord(box, 0, static_cast<uint32_t>(box.size()));
  box.replace(4, 8, "colrnclx");
  box[13] = box[15] = box[17] = static_cast<char>(matrix_coefficients);
  const size_t entry = bytes.find("stsd") + 12;
  bytes.insert(entry + WordAt(bytes, entry), box);
  for (const char* parent : {"moov", "trak", "mdia", "minf", "stbl", "stsd", "mp4v"}) {
    const size_t at = bytes.find(parent, bytes.find("moov")) - 4;
    SetWord(bytes, at, WordAt(bytes, at) + static_cast<uint32_t>(box.size()));
  }
}

void WriteFrames(cv::VideoWriter& writer, const std::vector<Image>& frames) {
  const cv::Size size(frames.front().width, frames.front().height);
  for (const Image& frame : frames) {
    const cv::Mat rgb(size, CV_8UC3, const_cast<uint8_t*>(frame.pixels.data()));
    cv::Mat bgr;
    cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
    writer.write(bgr);
  }
}

}  // namespace

void WriteVideo(const std::filesystem::path& path, const std::vector<Image>& frames) {
  const cv::Size size(frames.front().width, frames.front().height);
  cv::VideoWriter writer(path.string(), cv::CAP_OPENCV_MJPEG,
                         cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, size);
  ASSERT_TRUE(writer.isOpened());
  writer.set(cv::VIDEOWRITER_PROP_QUALITY, 95);
  WriteFrames(writer, frames);
}

void WriteMp4(const std::filesystem::path& path, const std::vector<Image>& frames,
              const Mp4Header& header) {
  const cv::Size size(frames.front().width, frames.front().height);
  cv::VideoWriter writer(path.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('m', 'p', '4', 'v'),
                         25, size);
  ASSERT_TRUE(writer.isOpened());
  WriteFrames(writer, frames);
  writer.release();
  std::ifstream file(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(file), {}};
  if (header.matrix_coefficients != 0) AddColours(header.matrix_coefficients, bytes);
  const size_t matrix = bytes.find("tkhd") + 44;
  const std::pair<size_t, int> entries[] = {
      {0, header.a}, {4, header.b}, {12, header.c}, {16, header.d}};
  for (const auto& [at, value] : entries) {
    SetWord(bytes, matrix + at, static_cast<uint32_t>(value) << 16);
  }
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
}

}  // namespace pepeseg::testing
