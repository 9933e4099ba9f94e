/* output_pending: the temporary files and folders of the process, so that a signal can remove them.
 * Internal to the host library. */
#ifndef CAIRN_HOST_OUTPUT_PENDING_H
#define CAIRN_HOST_OUTPUT_PENDING_H

/* Adds a path, which must stay valid until it is taken off. NULL is allowed in both calls. */
void output_pending_add(const char *path);
void output_pending_take(const char *path);

#endif
