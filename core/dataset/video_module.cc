// The module "video": decodes videos by FFmpeg.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/cpu.h>
#include <libswscale/swscale.h>
}

#include "core/dataset/video_decoder.h"

namespace pepeseg {
namespace {

// Packets of other tracks in front of one of the video's, and packets in a row that do not decode,
// after which the video counts as ended.
constexpr int kMostOthers = 4096;
constexpr int kMostFailures = 64;

// Frees FFmpeg's objects.
struct FfmpegDeleter {
  void operator()(AVFormatContext* file) const { avformat_close_input(&file); }
  void operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
};
template <class T>
using Owned = std::unique_ptr<T, FfmpegDeleter>;

double SecondsOf(const AVRational& time) {
  return time.num == 0 || time.den == 0 ? 0 : static_cast<double>(time.num) / time.den;
}

class FfmpegDecoder : public VideoDecoder {
 public:
  // Returns whether the file has a video track that can be decoded.
  bool Open(const char* path);

  int width() const override { return track_->codecpar->width; }
  int height() const override { return track_->codecpar->height; }
  int64_t num_frames() const override;
  bool Next() override;
  bool Picture(std::vector<uint8_t>& bgr) override;

 private:
  // Reads the next packet of the track; an empty one at the end. Returns false if there is none.
  bool ReadPacket();

  Owned<AVFormatContext> file_;
  Owned<AVCodecContext> codec_;
  const AVStream* track_ = nullptr;
  Owned<AVPacket> packet_{av_packet_alloc()};
  Owned<AVFrame> frame_{av_frame_alloc()};
  Owned<AVFrame> bgr_{av_frame_alloc()};
  Owned<SwsContext> scaler_;
  int64_t num_read_ = 0;
};

bool FfmpegDecoder::Open(const char* path) {
  if (packet_ == nullptr || frame_ == nullptr || bgr_ == nullptr) return false;
  AVFormatContext* file = nullptr;
  if (avformat_open_input(&file, path, nullptr, nullptr) < 0) return false;
  file_.reset(file);
  if (avformat_find_stream_info(file, nullptr) < 0) return false;
  for (unsigned i = 0; i < file->nb_streams && track_ == nullptr; ++i) {
    if (file->streams[i]->codecpar->codec_type == AVMEDIA_TYPE_VIDEO) track_ = file->streams[i];
  }
  if (track_ == nullptr) return false;
  const AVCodec* codec = avcodec_find_decoder(track_->codecpar->codec_id);
  if (codec == nullptr) return false;
  codec_.reset(avcodec_alloc_context3(codec));
  if (codec_ == nullptr) return false;
  codec_->thread_count = av_cpu_count();
  return avcodec_parameters_to_context(codec_.get(), track_->codecpar) >= 0 &&
         avcodec_open2(codec_.get(), codec, nullptr) >= 0;
}

int64_t FfmpegDecoder::num_frames() const {
  if (track_->nb_frames != 0) return track_->nb_frames;
  double seconds = static_cast<double>(file_->duration) / AV_TIME_BASE;
  if (seconds <= 0) seconds = static_cast<double>(track_->duration) * SecondsOf(track_->time_base);
  AVStream* track = file_->streams[track_->index];
  const double frames = seconds * SecondsOf(av_guess_frame_rate(file_.get(), track, nullptr));
  return frames > 0 ? static_cast<int64_t>(std::floor(std::min(frames, 1e15) + 0.5)) : 0;
}

bool FfmpegDecoder::ReadPacket() {
  for (int others = 0; others <= kMostOthers;) {
    av_packet_unref(packet_.get());
    const int error = av_read_frame(file_.get(), packet_.get());
    if (error == AVERROR(EAGAIN)) continue;
    if (error == AVERROR_EOF) {
      // An empty packet makes the decoder return the frames that it has kept.
      av_packet_unref(packet_.get());
      return true;
    }
    if (error < 0) return false;
    if (packet_->stream_index == track_->index) return true;
    ++others;
  }
  return false;
}

bool FfmpegDecoder::Next() {
  if (track_->nb_frames > 0 && num_read_ > track_->nb_frames) return false;
  // One packet may hold several frames.
  bool decoded = avcodec_receive_frame(codec_.get(), frame_.get()) >= 0;
  for (int failures = 0; !decoded && failures <= kMostFailures;) {
    if (!ReadPacket() || avcodec_send_packet(codec_.get(), packet_.get()) < 0) return false;
    const int error = avcodec_receive_frame(codec_.get(), frame_.get());
    decoded = error >= 0;
    if (!decoded && error != AVERROR(EAGAIN)) ++failures;
  }
  if (decoded) ++num_read_;
  return decoded;
}

bool FfmpegDecoder::Picture(std::vector<uint8_t>& bgr) {
  if (frame_->data[0] == nullptr || frame_->width != width() || frame_->height != height()) {
    return false;
  }
  scaler_.reset(sws_getCachedContext(scaler_.release(), width(), height(),
                                     static_cast<AVPixelFormat>(frame_->format), width(), height(),
                                     AV_PIX_FMT_BGR24, SWS_BICUBIC, nullptr, nullptr, nullptr));
  if (scaler_ == nullptr) return false;
  if (bgr_->data[0] == nullptr) {
    bgr_->format = AV_PIX_FMT_BGR24;
    bgr_->width = width();
    bgr_->height = height();
    // libswscale converts whole blocks of pixels, which the padding of the rows makes room for.
    constexpr int kRowAlignment = 32;
    if (av_frame_get_buffer(bgr_.get(), kRowAlignment) < 0) return false;
  }
  if (sws_scale(scaler_.get(), frame_->data, frame_->linesize, 0, height(), bgr_->data,
                bgr_->linesize) < 0) {
    return false;
  }
  const size_t row_bytes = size_t{3} * static_cast<size_t>(width());
  bgr.resize(row_bytes * static_cast<size_t>(height()));
  for (int y = 0; y < height(); ++y) {
    std::copy_n(bgr_->data[0] + static_cast<ptrdiff_t>(y) * bgr_->linesize[0], row_bytes,
                bgr.data() + static_cast<size_t>(y) * row_bytes);
  }
  return true;
}

}  // namespace
}  // namespace pepeseg

extern "C" __attribute__((visibility("default"))) pepeseg::VideoDecoder* PepesegOpenVideo(
    const char* path) {
  // FFmpeg's reports about broken files would go to the log in its own format.
  av_log_set_level(AV_LOG_QUIET);
  auto decoder = std::make_unique<pepeseg::FfmpegDecoder>();
  return decoder->Open(path) ? decoder.release() : nullptr;
}
