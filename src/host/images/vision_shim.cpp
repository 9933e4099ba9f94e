// libcairn-vision.so: OpenCV behind vision_shim.h.
//
// OpenCV throws exceptions, and prints those that it catches itself to std::cerr. Both become a
// status with a message.
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
#include "src/host/images/vision_shim.h"

namespace
{

// Gain of the 3 x 3 Sobel kernels: their response to a slope of one grey level per pixel.
constexpr double sobel_gain = 8;
// Of GrabCut: iterations, seed of its clusters' start, side of the median that smooths its edges.
constexpr int grab_iterations = 5, grab_seed = 1, grab_median_pixels = 5;

// Captures std::cerr during its lifetime.
class StderrCapture
{
  public:
    StderrCapture() : before(std::cerr.rdbuf(text.rdbuf()))
    {
    }
    ~StderrCapture()
    {
        std::cerr.rdbuf(before);
    }
    StderrCapture(const StderrCapture &) = delete;
    StderrCapture &operator=(const StderrCapture &) = delete;
    std::string message() const
    {
        return text.str();
    }

  private:
    std::ostringstream text;
    std::streambuf *before;
};

// Writes the text as one line and returns the status.
int32_t fail(int32_t status, const std::string &text, char *message, size_t capacity)
{
    std::string line;

    for (const char c : text)
        if (c != '\n' || (!line.empty() && line.back() != ' '))
            line += c == '\n' || c == '\t' ? ' ' : c;
    while (!line.empty() && line.back() == ' ')
        line.pop_back();
    (void)std::snprintf(message, capacity, "%s", line.c_str());
    return status;
}

// Silences OpenCV's log during its lifetime and then restores the program's log level.
class LogSilencer
{
  public:
    LogSilencer() : level(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT))
    {
    }
    ~LogSilencer()
    {
        cv::utils::logging::setLogLevel(level);
    }
    LogSilencer(const LogSilencer &) = delete;
    LogSilencer &operator=(const LogSilencer &) = delete;

  private:
    cv::utils::logging::LogLevel level;
};

// Runs a function that may throw and returns its status; exceptions become `refused`.
template <typename Work>
int32_t guarded(char *message, size_t capacity, int32_t refused, const Work &work) noexcept
{
    try {
        const LogSilencer quiet;

        return work();
    } catch (const cv::Exception &e) {
        return fail(e.code == cv::Error::StsNoMem ? CAIRN_NO_MEMORY : refused, e.err, message,
                    capacity);
    } catch (const std::bad_alloc &) {
        return fail(CAIRN_NO_MEMORY, "no memory", message, capacity);
    } catch (const std::exception &e) {
        return fail(refused, e.what(), message, capacity);
    } catch (...) {
        return fail(refused, "unknown", message, capacity);
    }
}

// Keeps the largest connected component of what is not 0.
void keep_largest(cv::Mat &mask)
{
    cv::Mat labels, stats, centres;
    const int count = cv::connectedComponentsWithStats(mask, labels, stats, centres, 8);
    int largest = 0, area = 0;

    for (int i = 1; i < count; i++)
        if (stats.at<int>(i, cv::CC_STAT_AREA) > area) {
            largest = i;
            area = stats.at<int>(i, cv::CC_STAT_AREA);
        }
    mask = largest > 0 ? cv::Mat(labels == largest) : cv::Mat::zeros(mask.size(), CV_8U);
}

int32_t grab(const uint8_t *bgr, int32_t width, int32_t height, const int32_t box[4],
             uint8_t *silhouette, char *message, size_t capacity)
{
    return guarded(message, capacity, CAIRN_BAD_ARGUMENT, [&]() -> int32_t {
        // cv::Mat takes no const data; the image is not written.
        const cv::Mat image(height, width, CV_8UC3, const_cast<uint8_t *>(bgr));
        cv::Mat labels, background, foreground, object, out(height, width, CV_8U, silhouette);

        cv::setRNGSeed(grab_seed);
        cv::grabCut(image, labels, cv::Rect(box[0], box[1], box[2], box[3]), background, foreground,
                    grab_iterations, cv::GC_INIT_WITH_RECT);
        object = (labels & 1) * 255;
        cv::medianBlur(object, object, grab_median_pixels);
        keep_largest(object);
        if (cv::countNonZero(object) == 0)
            return fail(CAIRN_EMPTY, "no object in the box", message, capacity);
        cv::bitwise_not(object, out);
        return CAIRN_OK;
    });
}

int32_t encode(const cairn_vision_shim_image *image, const char *ending, uint8_t **bytes,
               size_t *count, char *message, size_t capacity)
{
    return guarded(message, capacity, CAIRN_BAD_ARGUMENT, [&]() -> int32_t {
        const int type = CV_MAKETYPE(image->sample_bytes == 1 ? CV_8U : CV_16U, image->channels);
        const cv::Mat mat(image->height, image->width, type, image->samples);
        std::vector<uint8_t> buffer;
        const StderrCapture capture;

        if (!cv::imencode(ending, mat, buffer))
            return fail(CAIRN_BAD_ARGUMENT,
                        capture.message().empty() ? "it cannot be encoded" : capture.message(),
                        message, capacity);
        *bytes = static_cast<uint8_t *>(std::malloc(buffer.size() + 1));
        if (*bytes == nullptr)
            return fail(CAIRN_NO_MEMORY, "no memory", message, capacity);
        std::memcpy(*bytes, buffer.data(), buffer.size());
        *count = buffer.size();
        return CAIRN_OK;
    });
}

cv::Mat blurred(const uint8_t *grey, int32_t width, int32_t height, double sigma)
{
    // cv::Mat takes no const data; the image is not written.
    const cv::Mat mat(height, width, CV_8U, const_cast<uint8_t *>(grey));
    cv::Mat smooth;

    if (sigma > 0)
        cv::GaussianBlur(mat, smooth, cv::Size(0, 0), sigma, sigma, cv::BORDER_REPLICATE);
    else
        smooth = mat;
    return smooth;
}

int32_t gradients(const uint8_t *grey, int32_t width, int32_t height, double sigma, float *x,
                  float *y, char *message, size_t capacity)
{
    return guarded(message, capacity, CAIRN_BAD_ARGUMENT, [&]() -> int32_t {
        const cv::Mat smooth = blurred(grey, width, height, sigma);
        cv::Mat gradient_x(height, width, CV_32F, x), gradient_y(height, width, CV_32F, y);

        cv::Sobel(smooth, gradient_x, CV_32F, 1, 0, 3, 1 / sobel_gain, 0, cv::BORDER_REPLICATE);
        cv::Sobel(smooth, gradient_y, CV_32F, 0, 1, 3, 1 / sobel_gain, 0, cv::BORDER_REPLICATE);
        return CAIRN_OK;
    });
}

int32_t canny(const uint8_t *grey, int32_t width, int32_t height, double sigma, double low,
              double high, uint8_t *strengths, char *message, size_t capacity)
{
    return guarded(message, capacity, CAIRN_BAD_ARGUMENT, [&]() -> int32_t {
        const cv::Mat smooth = blurred(grey, width, height, sigma);
        cv::Mat gradient_x, gradient_y, edges;

        cv::Sobel(smooth, gradient_x, CV_16S, 1, 0, 3, 1, 0, cv::BORDER_REPLICATE);
        cv::Sobel(smooth, gradient_y, CV_16S, 0, 1, 3, 1, 0, cv::BORDER_REPLICATE);
        cv::Canny(gradient_x, gradient_y, edges, sobel_gain * low, sobel_gain * high, true);
        for (int v = 0; v < height; v++)
            for (int u = 0; u < width; u++) {
                const double magnitude =
                    std::hypot(static_cast<double>(gradient_x.at<int16_t>(v, u)),
                               static_cast<double>(gradient_y.at<int16_t>(v, u))) /
                    sobel_gain;

                *strengths++ = edges.at<uint8_t>(v, u) == 0
                                   ? 0
                                   : cv::saturate_cast<uint8_t>(std::fmax(1, 2 * magnitude));
            }
        return CAIRN_OK;
    });
}

const cairn_vision_shim table = {CAIRN_VISION_SHIM_VERSION, encode, gradients, canny, grab};

} // namespace

const cairn_vision_shim *cairn_vision_shim_table()
{
    return &table;
}
