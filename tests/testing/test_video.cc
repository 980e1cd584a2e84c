#include "tests/testing/test_video.h"

#include <gtest/gtest.h>

#include "opencv2/imgproc.hpp"
#include "opencv2/videoio.hpp"

namespace pepeseg::testing {

void WriteVideo(const std::filesystem::path& path, const std::vector<Image>& frames) {
  const cv::Size size(frames.front().width, frames.front().height);
  cv::VideoWriter writer(path.string(), cv::CAP_OPENCV_MJPEG,
                         cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, size);
  ASSERT_TRUE(writer.isOpened());
  writer.set(cv::VIDEOWRITER_PROP_QUALITY, 95);
  for (const Image& frame : frames) {
    const cv::Mat rgb(size, CV_8UC3, const_cast<uint8_t*>(frame.pixels.data()));
    cv::Mat bgr;
    cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
    writer.write(bgr);
  }
}

}  // namespace pepeseg::testing
