// OpenCV behind vision_shim.h: the whole of libcairn-vision.so.
//
// OpenCV throws, and prints what it has thrown where it catches it itself; both become a status
// with its words.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <new>
#include <sstream>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "cairn/status.h"
#include "src/host/vision_shim.h"

namespace
{

// Sobel's 3 x 3 kernels weigh a slope of one grey level per pixel eight times.
constexpr double sobel_gain = 8;

// What OpenCV prints on std::cerr meanwhile.
class Overheard
{
  public:
    Overheard() : before(std::cerr.rdbuf(text.rdbuf()))
    {
    }
    ~Overheard()
    {
        std::cerr.rdbuf(before);
    }
    Overheard(const Overheard &) = delete;
    Overheard &operator=(const Overheard &) = delete;
    std::string words() const
    {
        return text.str();
    }

  private:
    std::ostringstream text;
    std::streambuf *before;
};

// In one line.
int32_t fail(int32_t status, const std::string &text, char *words, size_t room)
{
    std::string line;

    for (const char c : text)
        if (c != '\n' || (!line.empty() && line.back() != ' '))
            line += c == '\n' || c == '\t' ? ' ' : c;
    while (!line.empty() && line.back() == ' ')
        line.pop_back();
    (void)std::snprintf(words, room, "%s", line.c_str());
    return status;
}

// Meanwhile OpenCV logs nothing; then it does again what the program that calls has it do.
class Quiet
{
  public:
    Quiet() : level(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT))
    {
    }
    ~Quiet()
    {
        cv::utils::logging::setLogLevel(level);
    }
    Quiet(const Quiet &) = delete;
    Quiet &operator=(const Quiet &) = delete;

  private:
    cv::utils::logging::LogLevel level;
};

// Runs the work, which may throw; its status.
template <typename Work>
int32_t guarded(char *words, size_t room, int32_t refused, const Work &work) noexcept
{
    try {
        const Quiet quiet;

        return work();
    } catch (const cv::Exception &e) {
        return fail(e.code == cv::Error::StsNoMem ? CAIRN_NO_MEMORY : refused, e.err, words, room);
    } catch (const std::bad_alloc &) {
        return fail(CAIRN_NO_MEMORY, "no memory", words, room);
    } catch (const std::exception &e) {
        return fail(refused, e.what(), words, room);
    } catch (...) {
        return fail(refused, "unknown", words, room);
    }
}

int32_t decode(const uint8_t *bytes, size_t count, cairn_vision_shim_image *image, char *words,
               size_t room)
{
    return guarded(words, room, CAIRN_BAD_FORMAT, [&]() -> int32_t {
        const std::vector<uint8_t> buffer(bytes, bytes + count);
        const Overheard overheard;
        cv::Mat picture = cv::imdecode(buffer, cv::IMREAD_UNCHANGED);

        if (picture.empty())
            return fail(CAIRN_BAD_FORMAT,
                        overheard.words().empty() ? "it cannot be decoded" : overheard.words(),
                        words, room);
        if ((picture.depth() != CV_8U && picture.depth() != CV_16U) ||
            (picture.channels() != 1 && picture.channels() != 3 && picture.channels() != 4))
            return fail(CAIRN_UNSUPPORTED, "samples of type " + cv::typeToString(picture.type()),
                        words, room);
        if (!picture.isContinuous())
            picture = picture.clone();
        const size_t size = picture.total() * picture.elemSize();
        image->samples = std::malloc(size);
        if (image->samples == nullptr)
            return fail(CAIRN_NO_MEMORY, "no memory", words, room);
        std::memcpy(image->samples, picture.data, size);
        image->width = picture.cols;
        image->height = picture.rows;
        image->channels = picture.channels();
        image->sample_bytes = picture.depth() == CV_8U ? 1 : 2;
        return CAIRN_OK;
    });
}

int32_t encode(const cairn_vision_shim_image *image, const char *ending, uint8_t **bytes,
               size_t *count, char *words, size_t room)
{
    return guarded(words, room, CAIRN_BAD_ARGUMENT, [&]() -> int32_t {
        const int type = CV_MAKETYPE(image->sample_bytes == 1 ? CV_8U : CV_16U, image->channels);
        const cv::Mat picture(image->height, image->width, type, image->samples);
        std::vector<uint8_t> buffer;
        const Overheard overheard;

        if (!cv::imencode(ending, picture, buffer))
            return fail(CAIRN_BAD_ARGUMENT,
                        overheard.words().empty() ? "it cannot be encoded" : overheard.words(),
                        words, room);
        *bytes = static_cast<uint8_t *>(std::malloc(buffer.size() + 1));
        if (*bytes == nullptr)
            return fail(CAIRN_NO_MEMORY, "no memory", words, room);
        std::memcpy(*bytes, buffer.data(), buffer.size());
        *count = buffer.size();
        return CAIRN_OK;
    });
}

cv::Mat blurred(const uint8_t *grey, int32_t width, int32_t height, double sigma)
{
    // OpenCV takes only what may be written; this is not.
    const cv::Mat picture(height, width, CV_8U, const_cast<uint8_t *>(grey));
    cv::Mat smooth;

    if (sigma > 0)
        cv::GaussianBlur(picture, smooth, cv::Size(0, 0), sigma, sigma, cv::BORDER_REPLICATE);
    else
        smooth = picture;
    return smooth;
}

int32_t gradients(const uint8_t *grey, int32_t width, int32_t height, double sigma, float *x,
                  float *y, char *words, size_t room)
{
    return guarded(words, room, CAIRN_BAD_ARGUMENT, [&]() -> int32_t {
        const cv::Mat smooth = blurred(grey, width, height, sigma);
        cv::Mat along_x(height, width, CV_32F, x), along_y(height, width, CV_32F, y);

        cv::Sobel(smooth, along_x, CV_32F, 1, 0, 3, 1 / sobel_gain, 0, cv::BORDER_REPLICATE);
        cv::Sobel(smooth, along_y, CV_32F, 0, 1, 3, 1 / sobel_gain, 0, cv::BORDER_REPLICATE);
        return CAIRN_OK;
    });
}

int32_t canny(const uint8_t *grey, int32_t width, int32_t height, double sigma, double low,
              double high, uint8_t *strengths, char *words, size_t room)
{
    return guarded(words, room, CAIRN_BAD_ARGUMENT, [&]() -> int32_t {
        const cv::Mat smooth = blurred(grey, width, height, sigma);
        cv::Mat along_x, along_y, edges;

        cv::Sobel(smooth, along_x, CV_16S, 1, 0, 3, 1, 0, cv::BORDER_REPLICATE);
        cv::Sobel(smooth, along_y, CV_16S, 0, 1, 3, 1, 0, cv::BORDER_REPLICATE);
        cv::Canny(along_x, along_y, edges, sobel_gain * low, sobel_gain * high, true);
        for (int v = 0; v < height; v++)
            for (int u = 0; u < width; u++) {
                const double slope = std::hypot(static_cast<double>(along_x.at<int16_t>(v, u)),
                                                static_cast<double>(along_y.at<int16_t>(v, u))) /
                                     sobel_gain;

                *strengths++ = edges.at<uint8_t>(v, u) == 0
                                   ? 0
                                   : cv::saturate_cast<uint8_t>(std::fmax(1, 2 * slope));
            }
        return CAIRN_OK;
    });
}

const cairn_vision_shim table = {CAIRN_VISION_SHIM_VERSION, decode, encode, gradients, canny};

} // namespace

const cairn_vision_shim *cairn_vision_shim_table()
{
    return &table;
}
