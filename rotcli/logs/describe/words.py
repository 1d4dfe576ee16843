"""The usual column names of logs, in lower case with underscores, the most usual first."""


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.split())


GYRO_WORDS = _words(
    "gyro gyros gyroscope gyroscopes gyr w g wx omega om angular_velocity angularvelocity "
    "ang_vel angvel angular_rate angularrate ang_rate angrate rotation_rate rotationrate "
    "rotational_rate rate_of_turn rot_rate gyro_rate gyrorate gyro_rad gyr_rad delta_angle "
    "delta_theta dtheta deltaangle del_ang delang dang w_rs_s rad body_rate uncomp_gyro "
    "uncompgyro imu_gyro gy ang_v angular_speed imu_angular_velocity gyroxyz angular_vel "
    "angular_velocities ar ars d_theta rate rates turn_rate turnrate gyro_rotation wib w_ib wb "
    "w_b gyro_adc gyroadc drehrate winkelgeschwindigkeit vitesse_angulaire"
)
ACCEL_WORDS = _words(
    "accel accels accelerometer accelerometers acceleration acc a f specific_force "
    "specificforce linear_acceleration linearacceleration lin_acc linacc lin_accel "
    "linear_accel sf fb acceleration_m_s2 accelerometer_m_s2 delta_velocity deltavelocity "
    "delta_vel delvel deltav dv a_rs_s uncomp_accel uncompaccel imu_accel imu_acc "
    "imu_linear_acceleration ac acceler body_accel d_vel dvel d_v lin_accel fib f_ib f_b "
    "accelerometer_acceleration acc_smooth accsmooth beschleunigung"
)
# Words after those of a sensor that leave its meaning.
STATES = _words(
    "raw cal calibrated comp compensated filt filtered unfilt unfiltered adc smooth smoothed out "
    "data meas measured corrected corr lsb counts sensor value reading ib_b ib b s rs_s is_s imu"
)
# Three columns of gyros that are named by the axes of a vehicle; the letters of one word first.
GYRO_TRIPLES = tuple(
    _words(text)
    for text in (
        "p q r",
        "roll_rate pitch_rate yaw_rate",
        "rollrate pitchrate yawrate",
        "rollspeed pitchspeed yawspeed",
        "roll_speed pitch_speed yaw_speed",
        "gyro_roll gyro_pitch gyro_yaw",
        "gyro_p gyro_q gyro_r",
    )
)
TIME_NAMES = _words(
    "time t timestamp time_stamp stamp times timestamps time_s time_sec t_s seconds "
    "time_seconds elapsed elapsed_time time_usec time_us timeus timestamp_us timestamp_ns "
    "timestamp_ms time_ms time_ns timestamp_s epoch unix_time unixtime ros_time rostime "
    "header_stamp field_header_stamp stamp_s datetime date_time utc utc_time utctime date "
    "gps_time gpstime gps_tow tow gps_sow sow seconds_of_week gps_seconds rosbagtimestamp "
    "sample_time sampletime timestartup time_startup millis micros time_of_week system_time "
    "host_time sensor_time sampletimefine clock zeit ts time_boot_ms timeboot arrival_time "
    "logging_time loggingtime"
)
SECOND_NAMES = _words(
    "sec secs stamp_sec header_stamp_sec stamp_secs header_stamp_secs field_header_stamp_sec "
    "field_header_stamp_secs time_sec t_sec s tv_sec unix_sec gps_sec epoch_sec"
)
NANOSECOND_NAMES = _words(
    "nanosec nanosecs nsec nsecs ns nanoseconds stamp_nanosec stamp_nsec stamp_nsecs "
    "header_stamp_nanosec header_stamp_nsec header_stamp_nsecs field_header_stamp_nsec "
    "field_header_stamp_nsecs time_nsec t_nsec tv_nsec tv_usec usec usecs microsec microsecs "
    "stamp_usec time_usec t_usec msec msecs millisec"
)
COUNTER_NAMES = _words(
    "sample samples n_samples sample_number sample_no sampleno sample_index sample_id "
    "packet_number packet_counter packetcounter packet counter count index idx seq sequence "
    "frame frame_number record record_number row number no nr n i id tick ticks"
)
INSTANCE_NAMES = _words(
    "i instance imu imu_id imuid imu_index sensor sensor_id sensorid device device_id unit multi_id"
)
ANGLE_NAMES = _words(
    "angle position pos angle_deg position_deg table_angle encoder encoder_angle theta "
    "angle_rad actual_position act_pos pos_act table_position enc encoder_position winkel "
    "rotation azimuth encoder_counts encoder_count counts position_counts rate_table_angle "
    "axis_angle axis_position pos_fbk position_feedback psi heading deg turns rev"
)
ANGLE_ENDINGS = _words("angle position pos encoder enc winkel counts count fbk feedback")
RATE_ENDINGS = _words("rate speed velocity vel omega rpm")
RATE_NAMES = _words(
    "rate speed velocity angular_velocity table_rate angular_rate rate_dps omega "
    "angular_speed actual_velocity actual_rate act_vel vel rpm table_speed axis_rate"
)
