/* JPEG by libjpeg, which returns from errors by longjmp: all state that must survive one is in a
 * struct.
 *
 * Method: the picture is decoded as grey or RGB; of four inks (CMYK, YCCK) as CMYK, which Adobe's
 * programs write inverted. Data that are missing inside the file are an error; other damage that
 * the decoder can live with is not. */
#include "src/base/build.h"

#include <stdio.h>

#include "src/host/images/vision_decode.h"

#ifdef CAIRN_HAVE_JPEG

#include <errno.h>
#include <setjmp.h>
#include <stdlib.h>

#include <jpeglib.h>
/* After jpeglib.h. */
#include <jerror.h>

/* Scans of a progressive file: more are written only to take time. */
#define MAX_SCANS 500

/* The decoder and what it returns to. */
typedef struct jpeg_work {
    struct jpeg_decompress_struct jpeg;
    struct jpeg_error_mgr errors;
    struct jpeg_progress_mgr progress;
    jmp_buf back;
    char problem[JMSG_LENGTH_MAX];
    int32_t is_cut; /* 1: data are missing */
    uint8_t *row;   /* of inks */
} jpeg_work;

static void on_error(j_common_ptr jpeg)
{
    jpeg_work *work = jpeg->client_data;

    (*jpeg->err->format_message)(jpeg, work->problem);
    longjmp(work->back, 1);
}

/* Warnings: level -1. */
static void on_message(j_common_ptr jpeg, int level)
{
    jpeg_work *work = jpeg->client_data;

    if (level == -1 &&
        (jpeg->err->msg_code == JWRN_HIT_MARKER || jpeg->err->msg_code == JWRN_JPEG_EOF)) {
        work->is_cut = 1;
        on_error(jpeg);
    }
}

static void on_progress(j_common_ptr jpeg)
{
    jpeg_work *work = jpeg->client_data;

    if (work->jpeg.input_scan_number > MAX_SCANS) {
        (void)snprintf(work->problem, sizeof work->problem, "more than %d scans", MAX_SCANS);
        longjmp(work->back, 1);
    }
}

static void swap_red_and_blue(uint8_t *row, int32_t width)
{
    for (int32_t x = 0; x < width; x++, row += 3) {
        uint8_t red = row[0];

        row[0] = row[2];
        row[2] = red;
    }
}

/* Reads the rows; errors of libjpeg return to the caller's setjmp. */
static cairn_status read_rows(cairn_vision_image *image, jpeg_work *work,
                              const cairn_vision_file *file)
{
    struct jpeg_decompress_struct *jpeg = &work->jpeg;
    int32_t is_ink = jpeg->num_components == 4;
    cairn_status status = cairn_vision_allocate(image, jpeg->image_width, jpeg->image_height,
                                                jpeg->num_components == 1 ? 1 : 3, 1, file);

    if (status != CAIRN_OK)
        return status;
    jpeg->out_color_space = jpeg->num_components == 1 ? JCS_GRAYSCALE : is_ink ? JCS_CMYK : JCS_RGB;
    work->row = malloc((size_t)image->width * 4);
    if (work->row == NULL)
        return cairn_file_error_system(file->error, file->path, "read", ENOMEM);
    (void)jpeg_start_decompress(jpeg);
    while (jpeg->output_scanline < jpeg->output_height) {
        uint8_t *to = (uint8_t *)image->samples + (size_t)jpeg->output_scanline *
                                                      (size_t)image->width *
                                                      (size_t)image->channels;
        JSAMPROW row = is_ink ? work->row : to;

        (void)jpeg_read_scanlines(jpeg, &row, 1);
        for (int32_t i = 0; is_ink && !jpeg->saw_Adobe_marker && i < 4 * image->width; i++)
            work->row[i] = (uint8_t)(255 - work->row[i]);
        for (int32_t x = 0; is_ink && x < image->width; x++)
            cairn_vision_from_inks(to + 3 * (size_t)x, work->row + 4 * (size_t)x);
        if (jpeg->num_components == 3)
            swap_red_and_blue(to, image->width);
    }
    (void)jpeg_finish_decompress(jpeg);
    return CAIRN_OK;
}

static cairn_status decode(cairn_vision_image *image, jpeg_work *work,
                           const cairn_vision_file *file)
{
    if (setjmp(work->back) != 0)
        return cairn_file_error_set(file->error, work->is_cut ? CAIRN_TRUNCATED : CAIRN_BAD_FORMAT,
                                    file->path, 0,
                                    "the JPEG data are damaged or cut (%s), expected a whole JPEG "
                                    "image",
                                    work->problem);
    jpeg_create_decompress(&work->jpeg);
    work->jpeg.client_data = work;
    jpeg_mem_src(&work->jpeg, file->bytes, (unsigned long)file->count);
    (void)jpeg_read_header(&work->jpeg, TRUE);
    work->progress.progress_monitor = on_progress;
    work->jpeg.progress = &work->progress;
    if (work->jpeg.num_components != 1 && work->jpeg.num_components != 3 &&
        work->jpeg.num_components != 4)
        return cairn_file_error_set(file->error, CAIRN_UNSUPPORTED, file->path, 0,
                                    "%d components, expected a JPEG image of 1, 3 or 4",
                                    work->jpeg.num_components);
    return read_rows(image, work, file);
}

cairn_status cairn_vision_decode_jpeg(cairn_vision_image *image, const cairn_vision_file *file)
{
    jpeg_work *work = calloc(1, sizeof *work);
    cairn_status status;

    if (work == NULL)
        return cairn_file_error_system(file->error, file->path, "read", ENOMEM);
    work->jpeg.err = jpeg_std_error(&work->errors);
    work->jpeg.client_data = work;
    work->errors.error_exit = on_error;
    work->errors.emit_message = on_message;
    status = decode(image, work, file);
    jpeg_destroy_decompress(&work->jpeg);
    free(work->row);
    free(work);
    return status;
}

#else

cairn_status cairn_vision_decode_jpeg(cairn_vision_image *image, const cairn_vision_file *file)
{
    (void)image;
    return cairn_file_error_set(file->error, CAIRN_UNSUPPORTED, file->path, 0,
                                "is a JPEG image: this program was built without libjpeg, expected "
                                "a PGM or PPM image (tools/deps.sh build)");
}

#endif
