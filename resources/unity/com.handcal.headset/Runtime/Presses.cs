using System;
using System.Collections.Generic;
using UnityEngine;
using UnityEngine.XR;
#if UNITY_WSA || UNITY_STANDALONE_WIN || UNITY_EDITOR_WIN
using UnityEngine.Windows.Speech;
#endif

namespace Handcal
{
    /// <summary>
    /// The wearer's presses. To confirm: a controller's trigger, an air tap or a pinch (of the other
    /// hand, so that the aligned one keeps still), Enter or space, or a spoken word. To nudge: a
    /// controller's stick and its two buttons, or arrow keys, plus and minus. A hand only confirms.
    /// </summary>
    sealed class Presses : IDisposable
    {
        const float StickPressed = 0.6f;

        /// <summary>
        /// A hand's own gesture: the primary button of OpenXR's Microsoft profile, the pointer and
        /// the pinch of its Hand Interaction Profile.
        /// </summary>
        static readonly InputFeatureUsage<bool>[] Gestures =
        {
            CommonUsages.triggerButton, CommonUsages.primaryButton,
            new InputFeatureUsage<bool>("PointerActivated"), new InputFeatureUsage<bool>("PinchTouched"),
        };

        readonly List<InputDevice> devices = new List<InputDevice>();
        int wasConfirming, wasRight, wasDown, wasLarger;
#if UNITY_WSA || UNITY_STANDALONE_WIN || UNITY_EDITOR_WIN
        readonly KeywordRecognizer recognizer;
#endif

        public Presses(string word, Action<long> confirmAt)
        {
#if UNITY_WSA || UNITY_STANDALONE_WIN || UNITY_EDITOR_WIN
            if (word.Length == 0 || !PhraseRecognitionSystem.isSupported) return;
            try
            {
                recognizer = new KeywordRecognizer(new[] { word });
                // The hand keeps still while the word is said, and may have moved since.
                recognizer.OnPhraseRecognized += said =>
                    confirmAt(HandcalHeadset.NowNs() - 100 * AgeTicks(said.phraseStartTime));
                recognizer.Start();
            }
            catch (UnityException error)  // speech is off in Windows' privacy settings, or no microphone
            {
                Debug.LogWarning("handcal: the spoken word does not confirm: " + error.Message);
            }
#endif
        }

        public bool IsConfirmed { get; private set; }

        /// <summary>Presses since the last call: to the right, down, larger; each -1, 0 or 1.</summary>
        public int Right { get; private set; }
        public int Down { get; private set; }
        public int Larger { get; private set; }

        /// <summary>Reads the devices; true if anything was pressed since the last call.</summary>
        public bool Read()
        {
            int confirming = 0, right = 0, down = 0, larger = 0;  // devices; of one, the other may be held
            InputDevices.GetDevices(devices);
            foreach (InputDevice device in devices)
            {
                if ((device.characteristics & InputDeviceCharacteristics.HandTracking) != 0)
                {
                    if (Array.Exists(Gestures, one => device.TryGetFeatureValue(one, out bool made) && made))
                        confirming++;
                    continue;
                }
                if (device.TryGetFeatureValue(CommonUsages.triggerButton, out bool trigger) && trigger) confirming++;
                if (device.TryGetFeatureValue(CommonUsages.primary2DAxis, out Vector2 stick))
                {
                    right += Sign(stick.x);
                    down -= Sign(stick.y);
                }
                if (device.TryGetFeatureValue(CommonUsages.primaryButton, out bool first) && first) larger++;
                if (device.TryGetFeatureValue(CommonUsages.secondaryButton, out bool second) && second) larger--;
            }
            right = Math.Sign(right);
            down = Math.Sign(down);
            larger = Math.Sign(larger);
            IsConfirmed = confirming > wasConfirming;
            Right = right == wasRight ? 0 : right;
            Down = down == wasDown ? 0 : down;
            Larger = larger == wasLarger ? 0 : larger;
            wasConfirming = confirming;
            wasRight = right;
            wasDown = down;
            wasLarger = larger;
            ReadKeys();
            return IsConfirmed || Right != 0 || Down != 0 || Larger != 0;
        }

        public void Dispose()
        {
#if UNITY_WSA || UNITY_STANDALONE_WIN || UNITY_EDITOR_WIN
            recognizer?.Dispose();
#endif
        }

        void ReadKeys()
        {
#if ENABLE_LEGACY_INPUT_MANAGER
            IsConfirmed |= Input.GetKeyDown(KeyCode.Return) || Input.GetKeyDown(KeyCode.Space)
                // The air tap of HoloLens 1, by the left and the right hand.
                || Input.GetKeyDown(KeyCode.JoystickButton14) || Input.GetKeyDown(KeyCode.JoystickButton15);
            Right += Pressed(KeyCode.RightArrow) - Pressed(KeyCode.LeftArrow);
            Down += Pressed(KeyCode.DownArrow) - Pressed(KeyCode.UpArrow);
            Larger += Pressed(KeyCode.Plus) + Pressed(KeyCode.KeypadPlus) + Pressed(KeyCode.Equals)
                - Pressed(KeyCode.Minus) - Pressed(KeyCode.KeypadMinus);
#endif
        }

#if ENABLE_LEGACY_INPUT_MANAGER
        static int Pressed(KeyCode key)
        {
            return Input.GetKeyDown(key) ? 1 : 0;
        }
#endif

#if UNITY_WSA || UNITY_STANDALONE_WIN || UNITY_EDITOR_WIN
        /// <summary>Time since a phrase began, of at most three seconds; 0 if the clocks disagree.</summary>
        static long AgeTicks(DateTime startUtc)
        {
            long ticks = (DateTime.UtcNow - startUtc).Ticks;
            return ticks < 0 || ticks > 3 * TimeSpan.TicksPerSecond ? 0 : ticks;
        }
#endif

        static int Sign(float value)
        {
            return value > StickPressed ? 1 : value < -StickPressed ? -1 : 0;
        }
    }
}
